// TMC2209 drivers on the line of UART1: they take what is written to their registers, answer what is asked, turn their motor, and DIAG tells a stall.
// What is sent on the line comes back, because both directions share one wire.
//
// TMC2209 data sheet: 4.1 (datagrams), 5.1 to 5.5 (registers), 11 (StallGuard4). A motor is held up at a stop. There it slips by an electrical period,
// four full steps, whenever it lags by more than two, as a motor does that is stepped on. At each full step its load is measured: BLOCKED where it is
// held up, FREE where it is not, and UNSURE, as low, if it is slow. DIAG is high from there to the next full step while the load is twice SGTHRS at
// most, a 256th of a step takes TCOOLTHRS cycles of 12 MHz at most, and the chopper is stealthChop.
import { CLOCK_HZ } from './machine.mjs';

const FREE = 300;
const BLOCKED = 20;
const UNSURE = 30;
// A 256th of a step of a slow motor, cycles: half a turn a second.
const SLOW = 470;
// Parts of a full step.
const PARTS = 256;
const PERIOD = 4 * PARTS;
const OWN_HZ = 12e6;
const [GCONF, CHOPCONF, TCOOLTHRS, SGTHRS] = [0x00, 0x6c, 0x14, 0x40];
const [GSTAT, IFCNT, NODECONF, DRV_STATUS] = [0x01, 0x02, 0x03, 0x6f];
const WAS_RESET = 1;
const STANDS = 2 ** 31;
const MASTER = 0xff;
// What may be read.
const READABLE = [GCONF, GSTAT, IFCNT, CHOPCONF, DRV_STATUS];
const SPREAD_CYCLE = 1 << 2;
const BY_REGISTER = 1 << 7;
// Microsteps by the address's pins.
const BY_PINS = [8, 32, 64, 16];
const SYNC = 5;

export function checksum(bytes) {
  let crc = 0;
  for (const byte of bytes) {
    for (let bit = 0; bit < 8; bit++) crc = ((crc << 1) ^ (((crc >> 7) ^ (byte >> bit)) & 1 ? 7 : 0)) & 0xff;
  }
  return crc;
}

// A driver, its motor, and the pin that its DIAG is at; `stop` is where the motor is held up, full steps, and whether that is above. One that has no
// power hears nothing, and its motor does not turn. A deaf one hears nothing and says nothing; its motor turns as its pins select.
class Driver {
  constructor(machine, { address, motor, gpio, stop, above, powered }) {
    Object.assign(this, { machine, address, motor, gpio, above, powered });
    this.stop = stop * PARTS;
    this.deaf = false;
    // DRV_STATUS, but for standstill.
    this.status = 0;
    this.reset();
    // Where steps say, how far the motor has slipped, and where it is, parts of a full step.
    this.command = 0;
    this.slip = 0;
    this.rotor = 0;
    this.isHeld = false;
    this.last = -Infinity;
    if (gpio !== undefined) machine.drive(gpio, false);
  }
  reset() {
    this.registers = new Map([[GSTAT, WAS_RESET]]);
    this.count = 0;
  }
  // What becomes of it.
  ail({ powered, deaf, reset, status, global }) {
    if (reset || powered === false) this.reset();
    this.powered = powered ?? this.powered;
    this.deaf = deaf ?? this.deaf;
    this.status = status ?? this.status;
    if (global) this.registers.set(GSTAT, this.get(GSTAT) | global);
  }
  get hears() { return this.powered && !this.deaf; }
  get(register) { return this.registers.get(register) ?? 0; }
  write(register, value) {
    if (!this.hears) return;
    this.count = (this.count + 1) & 0xff;
    this.registers.set(register, register === GSTAT ? this.get(GSTAT) & ~value : value);
  }
  // Bits for which it waits before it answers.
  get pause() { return 8 * ((this.get(NODECONF) >>> 8 & 0xe) + 1); }
  // Its answer to a request; none if it cannot.
  read(register) {
    if (!this.hears || !READABLE.includes(register)) return undefined;
    // A full step of more than an eighth of a second is standstill.
    const stands = this.machine.cycle - this.last > CLOCK_HZ / 8;
    const value = { [IFCNT]: this.count, [DRV_STATUS]: (this.status + (stands ? STANDS : 0)) }[register] ?? this.get(register);
    const bytes = [SYNC, MASTER, register, 0, 0, 0, 0];
    [24, 16, 8, 0].forEach((shift, n) => { bytes[3 + n] = value >>> shift & 0xff; });
    return [...bytes, checksum(bytes)];
  }
  get microsteps() {
    return this.get(GCONF) & BY_REGISTER ? PARTS >> (this.get(CHOPCONF) >>> 24 & 0xf) : BY_PINS[this.address];
  }

  stepped(sign, cycle) {
    if (!this.powered) return;
    const parts = PARTS / this.microsteps;
    const before = Math.floor(this.command / PARTS);
    this.command += sign * parts;
    this.turn();
    const part = (cycle - this.last) / parts * OWN_HZ / CLOCK_HZ;
    this.last = cycle;
    if (Math.floor(this.command / PARTS) !== before) this.measure(part);
  }

  turn() {
    const away = this.above ? -1 : 1;
    const lag = () => away * (this.stop - this.command - this.slip);
    if (lag() > 2 * PARTS) this.slip += away * PERIOD;
    this.isHeld ||= lag() > 0;
    this.rotor = this.command + this.slip + away * Math.max(0, lag());
  }

  // A full step has been made, a part of it in so many cycles of the driver.
  measure(part) {
    const load = this.isHeld ? BLOCKED : part > SLOW ? UNSURE : FREE;
    this.isHeld = false;
    const isQuiet = !(this.get(GCONF) & SPREAD_CYCLE);
    const stalls = isQuiet && load <= 2 * this.get(SGTHRS) && part <= this.get(TCOOLTHRS);
    if (this.gpio !== undefined) this.machine.drive(this.gpio, stalls);
    if (stalls) this.watch();
  }

  // A motor that stands still has no load: DIAG ends when a full step takes longer than TCOOLTHRS allows.
  watch() {
    const { machine } = this;
    const most = this.get(TCOOLTHRS) * PARTS * CLOCK_HZ / OWN_HZ;
    const alarm = machine.mcu.clock.createAlarm(() => {
      const left = this.last + most - machine.cycle;
      if (alarm !== this.alarm) return;
      if (left <= 0) machine.drive(this.gpio, false);
      else alarm.schedule(Math.max(left, 100) * 1e9 / CLOCK_HZ);
    });
    this.alarm = alarm;
    alarm.schedule(most * 1e9 / CLOCK_HZ);
  }
}

export class Drivers {
  // The board has drivers with these addresses, motor 1 first. Their motors have no stop, and DIAG leads nowhere.
  constructor(machine, motors, addresses = []) {
    this.machine = machine;
    this.own = addresses.map((address, motor) => ({ address, motor, stop: -Infinity, above: false, powered: true }));
    this.wire([]);
    this.bytes = [];
    machine.byteListeners.push((port, byte) => { if (port === 1) this.hear(byte); });
    motors.stepListeners.push((motor, sign, cycle) => {
      for (const driver of this.drivers) if (driver.motor === motor) driver.stepped(sign, cycle);
    });
  }

  // Drivers that stand for those of the board with their addresses.
  wire(drivers) {
    this.wired = drivers.map((one) => new Driver(this.machine, one));
    const others = this.own.filter(({ address }) => !drivers.some((one) => one.address === address));
    this.drivers = [...this.wired, ...others.map((one) => new Driver(this.machine, one))];
  }

  // What becomes of drivers: of all, if there is no address.
  ail(ails) {
    for (const one of ails) {
      for (const driver of this.drivers) if (driver.address === (one.address ?? driver.address)) driver.ail(one);
    }
  }

  // Where the motors are of those that were wired, full steps.
  get rotors() { return this.wired.map(({ rotor }) => rotor / PARTS); }

  hear(byte) {
    if (this.drivers.length) this.machine.uarts?.[1].feed(byte);
    this.bytes.push(byte);
    if (this.bytes[0] !== SYNC) this.bytes = [];
    const [, , register] = this.bytes;
    const length = register & 0x80 ? 8 : 4;
    if (this.bytes.length < length) return;
    const datagram = this.bytes;
    this.bytes = [];
    if (checksum(datagram.slice(0, -1)) !== datagram.at(-1)) return;
    const driver = this.drivers.find(({ address }) => address === datagram[1]);
    if (length === 4) return this.answer(driver, register);
    driver?.write(register & 0x7f, Buffer.from(datagram.slice(3, 7)).readUInt32BE());
  }

  // A driver answers after its pause, at the rate at which it was asked.
  answer(driver, register) {
    const answer = driver?.read(register);
    if (!answer) return;
    const { machine } = this;
    const alarm = machine.mcu.clock.createAlarm(() => machine.send(1, answer));
    alarm.schedule(driver.pause * machine.uarts[1].bit);
  }
}
