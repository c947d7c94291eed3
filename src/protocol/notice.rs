//! What the machine tells once: that it is ready, and that something has gone wrong.

use super::machine::Machine;
use super::status_text::status_text;
use super::token::Token;
use super::value::Value;
use super::write::{Format, Out, Writer};
use crate::boards::inputs;
use crate::config::Fixed;
use crate::progmem;
use crate::progmem::Text;
use crate::status::Status;
use crate::text;

/// The greeting after a reset:
/// `{"r":{"fv":0.970,"fb":440.20,"hp":1,"hv":8,"id":"...","msg":"SYSTEM READY"},"f":[1,0,0]}`.
pub struct Banner {
    stage: u8,
    format: Format,
}

/// The rows of `sys` that the greeting tells, in its order.
pub(super) const BANNER_ROWS: u8 = 5;

impl Banner {
    /// Begins. It is whole whatever the verbosity, unless that is 0.
    pub fn begin(machine: &impl Machine) -> Banner {
        let settings = machine.settings();
        let verbosity = if settings.json_verbosity() == 0 { 0 } else { u8::MAX };
        Banner { stage: 0, format: Format::response(settings.json_strict(), verbosity) }
    }

    /// Does the next part. Whether there is more to do.
    pub fn step(&mut self, machine: &mut impl Machine, out: &mut impl Out) -> bool {
        let mut writer = Writer::body(out, &mut self.format);
        if self.stage == 0 {
            writer.open();
            writer.key_text(text!("r"));
            writer.open();
        }
        match self.stage {
            0..BANNER_ROWS => {
                put_row(self.stage, machine, &mut writer);
            }
            BANNER_ROWS => {
                writer.key_text(text!("msg"));
                writer.string(text!("SYSTEM READY"));
            }
            _ => {
                writer.close();
                writer.footer(Status::Ok as u8, 0);
                return false;
            }
        }
        self.stage += 1;
        true
    }
}

/// One of the rows that tell who we are.
pub(super) fn put_row<O: Out>(row: u8, machine: &mut impl Machine, writer: &mut Writer<'_, O>) {
    // The version comes before the build.
    let token = Token::system(if row < 2 { 1 - row } else { row });
    writer.key(token.name().bytes());
    writer.shown(token.read(machine));
}

progmem! {
    /// What the switches at the ends of axes are called.
    static ENDS: [Text; inputs::ENDS] = [
        text!("xmin"), text!("xmax"), text!("ymin"), text!("ymax"),
        text!("zmin"), text!("zmax"), text!("amin"), text!("amax"),
    ];
}

/// An exception report, `{"er":{"fb":440.20,"st":13,"msg":"Buffer full"}}`; sent whatever the
/// verbosity, and always as JSON. Of a limit it also says which, `"sw":"xmin"`.
pub struct Exception {
    stage: u8,
    status: Status,
    format: Format,
}

impl Exception {
    /// Begins.
    pub fn begin(status: Status, machine: &impl Machine) -> Exception {
        Exception { stage: 0, status, format: Format::json(machine.settings().json_strict()) }
    }

    /// Does the next part. Whether there is more to do.
    pub fn step(&mut self, machine: &mut impl Machine, out: &mut impl Out) -> bool {
        let mut writer = Writer::body(out, &mut self.format);
        match self.stage {
            0 => {
                writer.open();
                writer.key_text(text!("er"));
                writer.open();
                let build = Token::system(0);
                writer.key(build.name().bytes());
                writer.shown(build.read(machine));
                writer.key_text(text!("st"));
                writer.fixed(Fixed::int((self.status as u8).into()));
            }
            1 => {
                if let Some(text) = status_text(self.status) {
                    writer.key_text(text!("msg"));
                    writer.string(text);
                }
            }
            2 => {
                let hit = machine.value(Value::LimitHit) as usize;
                if let Some(name) = ENDS.at(hit).filter(|_| self.status == Status::LimitHit) {
                    writer.key_text(text!("sw"));
                    writer.string(name);
                }
            }
            _ => {
                writer.text(text!("}}\n"));
                return false;
            }
        }
        self.stage += 1;
        true
    }
}
