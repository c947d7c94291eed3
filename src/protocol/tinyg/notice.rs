//! One-time notices: the greeting, exceptions, the result of a probing.

use super::Format;
use super::token::{Group, Token};
use super::value::PROBED;
use super::write::Writer;
use crate::boards::inputs;
use crate::config::{Fixed, Setting, Settings};
use crate::progmem;
use crate::progmem::Text;
use crate::protocol::{Ending, Machine, Occasion, Out, Value};
use crate::status::Status;
use crate::text;

/// The greeting after a reset:
/// `{"r":{"fv":0.970,"fb":440.20,"hp":1,"hv":8,"id":"...","kerf":"0.1.0","msg":"SYSTEM READY"},"f":[1,0,0]}`.
pub struct Banner {
    stage: u8,
    occasion: Occasion,
    format: Format,
}

/// The rows of `sys` in every greeting, in order. The greeting of a ready machine adds Kerf's version.
pub(super) const BANNER_ROWS: u8 = 5;

#[small]
impl Banner {
    /// Starts the greeting. It is complete at every verbosity except 0.
    pub fn begin(occasion: Occasion, settings: &Settings) -> Banner {
        Banner { stage: 0, occasion, format: Format::announcement(settings) }
    }

    /// Writes the next part. Returns whether there is more to do.
    #[inline(never)]
    pub fn step(&mut self, machine: &mut impl Machine, out: &mut impl Out) -> bool {
        let mut writer = Writer::frame(out, &mut self.format);
        if self.stage == 0 {
            writer.begin_response();
        }
        match self.stage {
            0..BANNER_ROWS => {
                put_row(self.stage, machine, &mut writer);
            }
            BANNER_ROWS => {
                // With the longer message the greeting would not fit into the port's ring buffer.
                if self.occasion == Occasion::Ready {
                    put_row(Setting::VERSION, machine, &mut writer);
                }
                writer.key_text(text!("msg"));
                writer.string(match self.occasion {
                    Occasion::Ready => text!("SYSTEM READY"),
                    Occasion::Defaults => text!("Initializing configs to default settings"),
                });
            }
            _ => {
                let status = match self.occasion {
                    Occasion::Ready => Status::Ok,
                    Occasion::Defaults => Status::Initializing,
                };
                writer.end_response(status, Ending::default());
                return false;
            }
        }
        self.stage += 1;
        true
    }
}

/// Writes one of the rows that identify the firmware.
#[small]
pub(super) fn put_row<O: Out>(row: u8, machine: &mut impl Machine, writer: &mut Writer<'_, O>) {
    // The version comes before the build.
    let token = Token::system(if row < 2 { 1 - row } else { row });
    writer.key(token.name().bytes());
    writer.shown(token.read(machine));
}

progmem! {
    /// The axes that can be homed.
    static AXES: [Text; 4] = [text!("x"), text!("y"), text!("z"), text!("a")];

    /// The names of the switches at the ends of axes.
    static ENDS: [Text; inputs::ENDS] = [
        text!("xmin"), text!("xmax"), text!("ymin"), text!("ymax"),
        text!("zmin"), text!("zmax"), text!("amin"), text!("amax"),
    ];
}

/// An exception report, `{"er":{"fb":440.20,"st":13,"msg":"Buffer full"}}`. Sent at every verbosity, and always as
/// JSON. A limit adds the switch, `"sw":"xmin"`, homing the axis, `"ax":"x"`, and a line of a file its number,
/// `"line":12`.
pub struct Exception {
    stage: u8,
    status: Status,
    format: Format,
    #[cfg(feature = "sd")]
    line: Option<u32>,
}

#[small]
impl Exception {
    /// Starts an exception report.
    pub fn begin(status: Status, settings: &Settings) -> Exception {
        Exception {
            stage: 0,
            status,
            format: Format::json(settings),
            #[cfg(feature = "sd")]
            line: None,
        }
    }

    /// Starts a report on a line of a file that has been refused.
    #[cfg(feature = "sd")]
    pub fn of_line(line: u32, status: Status, settings: &Settings) -> Exception {
        Exception { line: Some(line), ..Exception::begin(status, settings) }
    }

    /// Writes the next part. Returns whether there is more to do.
    #[inline(never)]
    pub fn step(&mut self, machine: &mut impl Machine, out: &mut impl Out) -> bool {
        let mut writer = Writer::body(out, &mut self.format);
        #[cfg(feature = "sd")]
        if self.stage == 2
            && let Some(line) = self.line
        {
            writer.key_text(text!("line"));
            writer.fixed(Fixed::int(line.cast_signed()));
        }
        let more = put_exception(self.stage, self.status, machine, &mut writer);
        self.stage += 1;
        more
    }
}

/// Writes a part of an exception report. Returns whether there is more to do.
#[small]
pub(super) fn put_exception<O: Out>(
    stage: u8,
    status: Status,
    machine: &mut impl Machine,
    writer: &mut Writer<'_, O>,
) -> bool {
    match stage {
        0 => {
            writer.open();
            writer.key_text(text!("er"));
            writer.open();
            let build = Token::system(0);
            writer.key(build.name().bytes());
            writer.shown(build.read(machine));
            writer.key_text(text!("st"));
            writer.fixed(Fixed::int(writer.variation().code(status).into()));
        }
        1 => {
            if let Some(text) = writer.variation().status_text(status) {
                writer.key_text(text!("msg"));
                writer.string(text);
            }
        }
        2 => {
            let hit = machine.value(Value::LimitHit) as usize;
            if let Some(name) = ENDS.at(hit).filter(|_| status == Status::LimitHit) {
                writer.key_text(text!("sw"));
                writer.string(name);
            }
            let axis = machine.value(Value::Blamed) as usize;
            if let Some(name) = AXES.at(axis).filter(|_| status.names_axis()) {
                writer.key_text(text!("ax"));
                writer.string(name);
            }
        }
        _ => {
            writer.text(text!("}}"));
            writer.end_line();
            return false;
        }
    }
    true
}

/// The result of a probing, in the form of a response: `{"r":{"prb":{"e":1,"x":20.000,...,"c":0.000}},"f":[1,0,0]}`.
pub struct Probing {
    member: u8,
    format: Format,
}

#[small]
impl Probing {
    /// Starts the report. It is complete at every verbosity except 0.
    pub fn begin(settings: &Settings) -> Probing {
        Probing { member: 0, format: Format::announcement(settings) }
    }

    /// Writes the next part. Returns whether there is more to do.
    #[inline(never)]
    pub fn step(&mut self, machine: &mut impl Machine, out: &mut impl Out) -> bool {
        let mut writer = Writer::frame(out, &mut self.format);
        let group = Group::Vector(PROBED);
        if self.member == 0 {
            writer.begin_response();
            writer.key(group.prefix().bytes());
            writer.open();
        }
        match group.member(self.member, machine) {
            Some((_, token)) => {
                let name = token.name();
                writer.key(name.bytes().get(group.prefix().bytes().len()..).unwrap_or_default());
                writer.shown(token.read(machine));
                self.member += 1;
                true
            }
            None => {
                writer.close();
                writer.end_response(Status::Ok, Ending::default());
                false
            }
        }
    }
}

/// Reports that a jog has ended.
pub fn jog_ended(settings: &Settings, out: &mut impl Out) {
    let mut format = Format::json(settings);
    let mut writer = Writer::body(out, &mut format);
    writer.open();
    writer.key_text(text!("jog"));
    writer.fixed(Fixed::int(0));
    writer.close();
    writer.end_line();
}

/// Answers an enquiry (ENQ).
#[small]
#[inline(never)]
pub fn acknowledge(settings: &Settings, out: &mut impl Out) {
    let mut format = Format::json(settings);
    let mut writer = Writer::body(out, &mut format);
    writer.text(text!("{\"ack\":true}"));
    writer.end_line();
}
