//! Heaters, their sensors and the fan: the decisions, without any pin.
//!
//! A printer has a hot end, a bed and a fan that cools what has been printed. What they are to be is said by lines ([`Orders`], which exec
//! changes in step with motion). Temperatures are integers, in eighths of a degree Celsius.

pub mod control;
pub mod fault;
pub mod heater;
pub mod sensor;
pub mod tune;

use crate::capability::Capability;
use crate::gcode::heating::{Heat, Part};

/// How many machines there are with heaters: none in an image that cannot print.
pub const PRINTERS: usize = Capability::Printer.is_built_in() as usize;
/// The hot end and the bed, in this order.
pub const HEATERS: usize = 2;

/// What program lines have asked for so far.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Orders {
    /// How hot each heater is to be, eighths of a degree; 0 for off.
    pub to: [u16; HEATERS],
    /// How fast the fan is to be, 255 for all it can.
    pub fan: u8,
}

#[small]
impl Orders {
    /// Everything off.
    pub const OFF: Self = Self { to: [0; HEATERS], fan: 0 };

    /// Does what a line asks for. Cost: 60 cycles.
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

/// How a heater stands.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Standing {
    /// How hot it is, eighths of a degree.
    pub now: i16,
    /// How hot it is to be, eighths of a degree; 0 for off.
    pub to: u16,
    /// How much of its power it has, 255 for all.
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
