//! Heaters, their sensors and the fan: control and supervision, without access to pins.
//!
//! A printer has a hot end, a bed and a part cooling fan. Program lines set their targets ([`Orders`], which exec
//! changes in step with motion). Temperatures are integers, in eighths of a degree Celsius.

pub mod control;
pub mod cooler;
pub mod fault;
pub mod heater;
pub mod sensor;
pub mod tune;

use crate::capability::Capability;
use crate::gcode::heating::{Heat, Part};

/// The number of machines with heaters: 0 in an image that cannot print, else 1.
pub const PRINTERS: usize = Capability::Printer.is_built_in() as usize;
/// The hot end and the bed, in this order.
pub const HEATERS: usize = 2;

/// The targets that program lines have set.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Orders {
    /// Target of each heater, eighths of a degree; 0 for off.
    pub to: [u16; HEATERS],
    /// Speed of the fan, 255 for full speed.
    pub fan: u8,
}

#[small]
impl Orders {
    /// Everything off.
    pub const OFF: Self = Self { to: [0; HEATERS], fan: 0 };

    /// Takes over the targets of a line. Cost: 60 cycles.
    pub fn carry_out(&mut self, heat: &Heat) {
        let Some(to) = heat.to else { return };
        let [hot_end, bed] = &mut self.to;
        match heat.part {
            Part::HotEnd => *hot_end = to,
            Part::Bed => *bed = to,
            Part::Fan => self.fan = to as u8,
            Part::All => (*hot_end, *bed, self.fan) = (to, to, to as u8),
        }
    }
}

/// The state of a heater that reports show.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Standing {
    /// Present temperature, eighths of a degree.
    pub now: i16,
    /// Target, eighths of a degree; 0 for off.
    pub to: u16,
    /// Present power, 255 for full power.
    pub power: u8,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gcode::heating::Wait;

    #[test]
    fn orders_are_for_their_part() {
        let mut orders = Orders::OFF;
        let mut ask = |part, to| {
            orders.carry_out(&Heat { part, to, wait: Wait::Hot });
            (orders.to, orders.fan)
        };
        assert_eq!(ask(Part::HotEnd, Some(1_600)), ([1_600, 0], 0));
        assert_eq!(ask(Part::Bed, Some(480)), ([1_600, 480], 0));
        assert_eq!(ask(Part::Fan, Some(255)), ([1_600, 480], 255));
        assert_eq!(ask(Part::Bed, None), ([1_600, 480], 255));
        orders.carry_out(&Heat::OFF);
        assert_eq!(orders, Orders::OFF);
    }
}
