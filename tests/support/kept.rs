//! A machine that finds something in its EEPROM, and a sender on its port.

use std::thread;

use kerf::hal::imp::{Machine, eeprom};

/// A sender's end of the line.
pub struct Sender(pub Machine);

impl Sender {
    /// Sends a text, and returns what the machine sends within some milliseconds.
    pub fn ask(&mut self, text: &str, ms: u64) -> String {
        self.0.send(text.as_bytes());
        self.0.run_ms(ms);
        String::from_utf8(self.0.received()).expect("ASCII")
    }
}

/// Does something in TinyG's dialect with a machine that has these EEPROM contents, in a thread of its own.
pub fn with<T: Send + 'static>(
    contents: impl AsRef<[u8]>,
    run: impl FnOnce(&mut Sender) -> T + Send + 'static,
) -> T {
    with_open(contents, |sender| {
        sender.ask("{}\n", 20);
        run(sender)
    })
}

/// Does something with a machine that has these EEPROM contents and has been sent nothing, in a thread of its own.
pub fn with_open<T: Send + 'static>(
    contents: impl AsRef<[u8]>,
    run: impl FnOnce(&mut Sender) -> T + Send + 'static,
) -> T {
    let contents = contents.as_ref().to_vec();
    let machine = move || {
        eeprom::put(&contents);
        let mut sender = Sender(Machine::boot(115_200).expect("one machine for each thread"));
        sender.ask("", 100);
        run(&mut sender)
    };
    thread::spawn(machine).join().unwrap()
}
