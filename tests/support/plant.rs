//! Heaters that tests simulate: where the heat goes, and what the sensor sees of it.

/// A heater with its sensor: heat flows from the heater into the block, from the block to the air, and the sensor follows the block.
pub struct Plant {
    /// Joules for a degree.
    capacity: f64,
    /// Of the heater.
    pub watts: f64,
    /// Watts a degree to the air, and with the fan besides.
    loss: f64,
    fan: f64,
    /// How far the heater is behind its current, and the sensor behind the block, seconds.
    delay: [f64; 2],
    heater: f64,
    /// How hot the block is, degrees.
    pub block: f64,
    /// How hot the sensor is, degrees.
    pub sensor: f64,
}

/// Degrees.
pub const AIR: f64 = 22.0;

impl Plant {
    /// 40 W, 200 degrees in 90 s.
    pub fn hot_end() -> Self {
        let delay = [2.0, 1.5];
        Self {
            capacity: 14.0,
            watts: 40.0,
            loss: 0.09,
            fan: 0.03,
            delay,
            heater: 0.0,
            block: AIR,
            sensor: AIR,
        }
    }

    /// 120 W, 60 degrees in 4 minutes.
    pub fn bed() -> Self {
        let delay = [5.0, 4.0];
        Self {
            capacity: 600.0,
            watts: 120.0,
            loss: 1.2,
            fan: 0.0,
            delay,
            heater: 0.0,
            block: AIR,
            sensor: AIR,
        }
    }

    /// Time passes with some part of the heater's power, or with it on or off, and of the fan's.
    pub fn pass(&mut self, seconds: f64, power: impl Into<f64>, fan: impl Into<f64>) {
        let watts = self.watts * power.into();
        self.heater += (watts - self.heater) * seconds / self.delay[0];
        let loss = self.loss + self.fan * fan.into();
        self.block += (self.heater - loss * (self.block - AIR)) * seconds / self.capacity;
        self.sensor += (self.block - self.sensor) * seconds / self.delay[1];
    }
}
