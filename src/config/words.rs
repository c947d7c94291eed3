//! What text mode calls the settings: a row beside each row of [`table`](super::table), in program
//! memory.

use super::table::{
    AXIS_ROWS, COOLANT_ROWS, MOTOR_ROWS, PWM_ROWS, SPINDLE_ROWS, SQUARING_ROWS, SYSTEM_ROWS,
};
use super::{Owner, Setting};
use crate::progmem;
use crate::progmem::Text;
use crate::text;

/// What is shown of a setting beside its value.
#[derive(Clone, Copy)]
pub struct Words {
    /// What it is, behind whose it is.
    pub title: Text,
    /// A length or an angle: its unit comes behind the value.
    pub length: bool,
    /// What comes behind that: the rest of the unit, or the choices.
    pub tail: Text,
    /// Decimals, if text mode shows others than JSON.
    pub decimals: Option<u8>,
}

const fn words(title: Text, tail: Text) -> Words {
    Words { title, length: false, tail, decimals: None }
}

const fn length(title: Text, tail: Text) -> Words {
    Words { title, length: true, tail, decimals: None }
}

const fn bare(title: Text) -> Words {
    words(title, text!(""))
}

impl Words {
    const fn with_decimals(mut self, decimals: u8) -> Words {
        self.decimals = Some(decimals);
        self
    }
}

const OFF_ON: Text = text!(" [0=off,1=on]");
const POLARITY: Text = text!(" [0=normal,1=reverse]");
const SWITCHES: Text = text!(" [0=off,1=homing,2=limit,3=limit+homing]");
const SPEED: Text = text!("/min");
const JERK: Text = text!("/min^3 * 1 million");
const TURNS: Text = text!(" RPM");
const PHASE: Text = text!(" [0..1]");
const LEVEL: Text = text!(" [0=active low,1=active high]");
const NONE: Text = text!("");

progmem! {
    static SYSTEM: [Words; SYSTEM_ROWS] = [
        bare(text!("firmware build")),
        bare(text!("firmware version")).with_decimals(2),
        bare(text!("hardware platform")).with_decimals(2),
        bare(text!("hardware version")).with_decimals(2),
        bare(text!("TinyG ID")),
        length(text!("junction acceleration"), NONE),
        length(text!("chordal tolerance"), NONE),
        bare(text!("soft limit enable")),
        words(text!("switch type"), text!(" [0=NO,1=NC]")),
        words(text!("motor idle timeout"), text!(" Sec")),
        words(text!("enable json mode"), text!(" [0=text,1=JSON]")),
        words(
            text!("json verbosity"),
            text!(" [0=silent,1=footer,2=messages,3=configs,4=linenum,5=verbose]"),
        ),
        words(text!("json serialize style"), text!(" [0=relaxed,1=strict]")),
        words(text!("text verbosity"), text!(" [0=silent,1=verbose]")),
        words(text!("queue report verbosity"), text!(" [0=off,1=single,2=triple]")),
        words(text!("status report verbosity"), text!(" [0=off,1=filtered,2=verbose]")),
        words(text!("status interval"), text!(" ms")),
        words(text!("expand LF to CRLF on TX"), OFF_ON),
        words(text!("enable echo"), OFF_ON),
        words(text!("enable flow control"), text!(" [0=off,1=XON/XOFF,2=RTS/CTS]")),
        words(text!("serial RX mode"), text!(" [0=char_mode,1=line_mode]")),
        words(
            text!("USB baud rate"),
            text!(" [1=9600,2=19200,3=38400,4=57600,5=115200,6=230400]"),
        ),
        words(text!("network mode"), text!(" [0=master]")),
        words(text!("default gcode plane"), text!(" [0=G17,1=G18,2=G19]")),
        words(text!("default gcode units mode"), text!(" [0=G20,1=G21]")),
        words(text!("default gcode coord system"), text!(" [1-9 (G54-G59.3)]")),
        words(text!("default gcode path control"), text!(" [0=G61,1=G61.1,2=G64]")),
        words(text!("default gcode distance mode"), text!(" [0=G90,1=G91]")),
        words(text!("block delete"), OFF_ON),
        words(text!("optional stop"), OFF_ON),
        words(text!("program stop waits"), OFF_ON),
        words(text!("protocol dialect"), text!(" [0=TinyG,1=g2core]")),
        words(text!("step pulse width"), text!(" us")),
        words(text!("direction setup time"), text!(" us")),
        words(text!("safety door"), text!(" [0=off,1=NO,2=NC]")),
        words(text!("emergency stop"), text!(" [0=off,1=NO,2=NC]")),
        words(text!("machine"), text!(" [0=careful,1=router,2=mill,3=printer,4=lathe]")),
    ];

    static MOTOR: [Words; MOTOR_ROWS] = [
        words(text!("map to axis"), text!(" [0=X,1=Y,2=Z...]")),
        words(text!("step angle"), text!(" deg")),
        length(text!("travel per revolution"), NONE),
        words(text!("microsteps"), text!(" [1,2,4,8]")),
        words(text!("polarity"), POLARITY),
        words(
            text!("power management"),
            text!(" [0=disabled,1=always on,2=in cycle,3=when moving]"),
        ),
        words(text!("step polarity"), POLARITY),
    ];

    static AXIS: [Words; AXIS_ROWS] = [
        bare(text!("axis mode")),
        length(text!("velocity maximum"), SPEED),
        length(text!("feedrate maximum"), SPEED),
        length(text!("travel minimum"), NONE),
        length(text!("travel maximum"), NONE),
        length(text!("jerk maximum"), JERK),
        length(text!("jerk homing"), JERK),
        length(text!("junction deviation"), text!(" (larger is faster)")),
        length(text!("radius value"), NONE).with_decimals(4),
        words(text!("switch min"), SWITCHES),
        words(text!("switch max"), SWITCHES),
        length(text!("search velocity"), SPEED),
        length(text!("latch velocity"), SPEED),
        length(text!("latch backoff"), NONE),
        length(text!("zero backoff"), NONE),
        length(text!("acceleration maximum"), text!("/s^2 (0 is none)")),
    ];

    static PWM: [Words; PWM_ROWS] = [
        words(text!("pwm frequency"), text!(" Hz")),
        words(text!("pwm cw speed lo"), TURNS),
        words(text!("pwm cw speed hi"), TURNS),
        words(text!("pwm cw phase lo"), PHASE),
        words(text!("pwm cw phase hi"), PHASE),
        words(text!("pwm ccw speed lo"), TURNS),
        words(text!("pwm ccw speed hi"), TURNS),
        words(text!("pwm ccw phase lo"), PHASE),
        words(text!("pwm ccw phase hi"), PHASE),
        words(text!("pwm phase off"), PHASE),
    ];

    static SPINDLE: [Words; SPINDLE_ROWS] = [
        words(text!("spindle pause on hold"), OFF_ON),
        words(text!("spindle spinup delay"), text!(" seconds")),
        words(text!("spindle enable polarity"), LEVEL),
        words(text!("spindle direction polarity"), text!(" [0=CW is low,1=CW is high]")),
    ];

    static COOLANT: [Words; COOLANT_ROWS] = [words(text!("coolant pause on hold"), OFF_ON)];

    static SQUARING: [Words; SQUARING_ROWS] =
        [bare(text!("squaring switch")), bare(text!("squaring offset"))];
}

impl Setting {
    /// What text mode calls it.
    pub fn words(self) -> Option<Words> {
        let index = usize::from(self.index());
        match self.owner() {
            Owner::System => SYSTEM.at(index),
            Owner::Motor(_) => MOTOR.at(index),
            Owner::Axis(_) => AXIS.at(index),
            Owner::Pwm => PWM.at(index),
            Owner::Spindle => SPINDLE.at(index),
            Owner::Coolant => COOLANT.at(index),
            Owner::Squaring => SQUARING.at(index),
            Owner::User(_) => Some(bare(text!("user data"))),
            Owner::Job => Some(bare(text!("job id"))),
        }
    }
}
