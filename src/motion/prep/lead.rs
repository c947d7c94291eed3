//! Pressure advance: the lead of the extruder in the segments of a block. [`Advance`](super::super::advance::Advance)
//! computes the lead.

use super::super::advance::{Lead, pushed};
use super::super::block::Line;
use super::super::smooth::{CHANNELS, LEAD};
use super::minor::Minor;
use super::{ASIDE, ASIDE_LITTLE, Prep, TURNED};
use crate::dda::Segment;

/// Returns how far a line pushes filament while other motors than that of the extruder, `m`, travel: phase units.
fn own_of(line: &Line, m: usize) -> u32 {
    let own = line.way.get(m).copied().unwrap_or(0);
    let travels = line.way.iter().enumerate().any(|(other, way)| other != m && *way != 0);
    if travels { pushed(own, line) } else { 0 }
}

impl Prep {
    /// Whether there is a lead of the extruder, or may be one. Cost: 5.
    #[inline(always)]
    pub(super) fn has_advance(&self) -> bool {
        self.extruder.first().is_some_and(|extruder| extruder.on)
    }

    /// Whether the extruder has a lead in the block, or takes one back. If so, exec passes the velocity
    /// ([`Prep::aim`]).
    #[inline(always)]
    pub fn leads(&self) -> bool {
        self.extruder.first().is_some_and(|extruder| extruder.leads)
    }

    /// Sets the extruder's lead, from the next block on.
    #[small]
    pub fn set_lead(&mut self, lead: &Lead) {
        if let Some(extruder) = self.extruder.first_mut() {
            extruder.set(lead);
        }
    }

    /// Takes in the velocity at the end of a stretch, mm/s: see [`Advance::aim`](super::super::advance::Advance::aim).
    #[inline(never)]
    pub fn aim(&mut self, velocity: f32, seconds: f32) {
        if let Some(extruder) = self.extruder.first_mut() {
            extruder.aim(velocity, seconds);
        }
    }

    /// Begins the lead of a block. The extruder has one if the block pushes filament while other motors travel. It then
    /// has its own increments, and no longer counts as a motor that goes as far as others.
    #[inline(never)]
    #[small]
    pub(super) fn begin_lead(&mut self, line: &Line) {
        let Some(extruder) = self.extruder.first_mut() else { return };
        let m = usize::from(extruder.motor);
        let bit = 1 << extruder.motor;
        let way = own_of(line, m);
        let leads = extruder.begin(way, line.extent.length()) && self.most != 0;
        if !leads {
            extruder.end();
            return self.end_lead();
        }
        extruder.take_up(self.backwards & bit != 0);
        if self.full & bit != 0 && self.full != bit {
            self.full &= !bit;
            self.minor |= bit;
        } else if (self.full | self.minor) & bit == 0 {
            self.minor |= bit;
            self.others += 1;
            if let Some(minor) = self.minors.get_mut(m) {
                *minor = Minor::default();
            }
        } else if self.others == 0 {
            // Only the extruder moves: its ticks are those of motors whose increments are not a step.
            self.others = 1;
        }
    }

    /// Begins the lead of a block whose distances are sampled.
    #[small]
    pub fn begin_sampled(&mut self, line: &Line) {
        if self.has_advance()
            && let Some(extruder) = self.extruder.first_mut()
        {
            extruder.begin_sampled(own_of(line, usize::from(extruder.motor)), line.extent.length());
        }
    }

    /// Returns by how much the lead for this velocity along the path, mm/s, is above that of the last sample, phase
    /// units.
    #[inline(always)]
    pub fn lead_more(&mut self, velocity: f32) -> i32 {
        match self.extruder.first_mut() {
            Some(extruder) if extruder.on => extruder.step_to(velocity),
            _ => 0,
        }
    }

    /// Takes in how far the lead is to go in a sample. The motors of the sample have been collected.
    #[inline(never)]
    #[small]
    pub(super) fn aim_sampled(&mut self, distances: &[i32; CHANNELS]) {
        let Some(extruder) = self.extruder.first_mut() else { return };
        let more = distances.get(LEAD).copied().unwrap_or_default();
        let bit = 1 << extruder.motor;
        let backwards = self.backwards & bit != 0;
        if !extruder.aim_by(more) {
            // The next segment reverses the motor.
            self.turned |= core::mem::take(&mut extruder.leads) && extruder.backwards != backwards;
            return;
        }
        extruder.take_up(backwards);
        let moving = self.full | self.minor;
        (self.full, self.minor) = (0, moving | bit);
        if moving & bit == 0 && moving != 0 {
            self.others += 1;
        }
        // Its ticks are those of motors whose increments are not a step.
        self.others = self.others.max(1);
    }

    /// Adds the extruder's lead to a segment that is complete except for its mode.
    #[inline(never)]
    pub(super) fn lead(&mut self, out: &mut Segment) {
        let Some(extruder) = self.extruder.first_mut() else { return };
        let more = extruder.travel(out.ticks, out.period);
        let bit = 1 << extruder.motor;
        let Some(increment) = out.increment.get_mut(usize::from(extruder.motor)) else { return };
        let size = i32::from(*increment);
        let own = if out.backwards & bit != 0 { -size } else { size };
        let most = extruder.most(out.period).max(size);
        let mut goes = (own + more).clamp(-most, most);
        if goes != 0 && (goes < 0) != extruder.backwards {
            extruder.backwards = goes < 0;
            if out.period.saturating_sub(TURNED) < self.setup {
                // The direction is set from this segment on, and the motor moves in the next one.
                goes = 0;
            }
        }
        *increment = goes.unsigned_abs() as u16;
        out.backwards = out.backwards & !bit | if extruder.backwards { bit } else { 0 };
        extruder.note(goes - own, more, (out.ticks, out.period));
        if extruder.is_done() {
            self.end_lead();
        }
    }

    /// Ends the lead of the block: the remaining lead is small.
    #[inline(never)]
    #[small]
    fn end_lead(&mut self) {
        let Some(extruder) = self.extruder.first_mut() else { return };
        let bit = 1 << extruder.motor;
        if core::mem::take(&mut extruder.leads) {
            // The next segment reverses the motor.
            self.turned |= extruder.backwards != (self.backwards & bit != 0);
        }
        if self.full == bit && self.minor == 0 {
            self.others = 0;
        } else if self.minor & bit != 0
            && self.minors.get(usize::from(extruder.motor)).is_some_and(Minor::stands)
        {
            self.minor &= !bit;
            self.others = self.others.saturating_sub(1);
        }
    }

    /// Makes a segment in which the extruder takes back the remainder of its lead: the machine stands still at the end
    /// of its lines, or in a hold. Returns false, and no segment, if no lead is left.
    #[inline(always)]
    pub fn relax(&mut self, out: &mut Segment) -> bool {
        self.has_advance() && self.takes_back(out)
    }

    #[inline(never)]
    #[small]
    fn takes_back(&mut self, out: &mut Segment) -> bool {
        let Some(extruder) = self.extruder.first_mut() else { return false };
        if extruder.made() == 0 {
            return false;
        }
        let bit = 1 << extruder.motor;
        extruder.take_up(self.backwards & bit != 0);
        let (ticks, period) = if extruder.rest() { ASIDE_LITTLE } else { ASIDE };
        self.pause(ticks, period, out);
        out.moving = bit;
        self.lead(out);
        out.mode = Segment::mode_of(bit);
        true
    }
}
