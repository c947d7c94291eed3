//! Simulated heaters for tests: the flow of heat, and the temperature of the sensor.

/// A heater with its sensor. Heat flows from the heater into the block and from the block to the air, and the sensor
/// follows the block.
pub struct Plant {
    /// Heat capacity of the block, joules per degree.
    capacity: f64,
    /// Power of the heater.
    pub watts: f64,
    /// Loss to the air without the fan, watts per degree.
    loss: f64,
    fan: f64,
    /// Time constants of the heater behind its current and of the sensor behind the block, seconds.
    delay: [f64; 2],
    heater: f64,
    /// Temperature of the air around it, degrees.
    pub air: f64,
    /// Temperature of the block, degrees.
    pub block: f64,
    /// Temperature of the sensor, degrees.
    pub sensor: f64,
}

/// Temperature of the air, degrees.
pub const AIR: f64 = 22.0;

impl Plant {
    /// A heater of this heat capacity (joules per degree), power (watts), loss without the fan and additional loss with
    /// it (watts per degree), and time constants (seconds).
    pub fn of(capacity: f64, watts: f64, loss: f64, fan: f64, delay: [f64; 2]) -> Self {
        Self { capacity, watts, loss, fan, delay, heater: 0.0, air: AIR, block: AIR, sensor: AIR }
    }

    /// A hot end of 40 W that reaches 200 degrees in 90 s.
    pub fn hot_end() -> Self {
        Self::of(14.0, 40.0, 0.09, 0.03, [2.0, 1.5])
    }

    /// A bed of 120 W that reaches 60 degrees in 4 minutes.
    pub fn bed() -> Self {
        Self::of(600.0, 120.0, 1.2, 0.0, [5.0, 4.0])
    }

    /// The temperature that full power holds with the fan at full speed, degrees.
    #[allow(dead_code, reason = "each test uses a part")]
    pub fn most(&self) -> f64 {
        self.air + self.watts / (self.loss + self.fan)
    }

    /// Lets time pass with a share of the heater's power and of the fan's; a `bool` is all or nothing.
    pub fn pass(&mut self, seconds: f64, power: impl Into<f64>, fan: impl Into<f64>) {
        let watts = self.watts * power.into();
        self.heater += (watts - self.heater) * seconds / self.delay[0];
        let loss = self.loss + self.fan * fan.into();
        self.block += (self.heater - loss * (self.block - self.air)) * seconds / self.capacity;
        self.sensor += (self.block - self.sensor) * seconds / self.delay[1];
    }
}
