// The USB of the RP2040 as a device, the bus, and a computer with one program that talks to a CDC ACM port of it. That of rp2040js gives buffers back
// before anything has come, and keeps no order of packets.
//
// The bus has frames, may sleep, be reset, and lose its cable; packets may be damaged (`Usb.damage`, `Usb.noise`). The device takes them as the data sheet
// says: what is damaged on the way to it sets a bit of SIE_STATUS and is not answered; without an ACK it sends the same packet again; a packet that comes
// again is acknowledged and dropped. With erratum E15 (`hang`) it does nothing any more until the unit is reset: neither packets, nor frames, nor what
// the bus signals.
import { BasePeripheral } from 'rp2040js';

const IRQ = 5;
// Registers.
const ADDR_ENDP = 0x00;
const SIE_CTRL = 0x4c;
const SOF_RD = 0x48;
const SIE_STATUS = 0x50;
const BUFF_STATUS = 0x58;
const EP_STALL_ARM = 0x68;
const INTR = 0x8c;
const INTE = 0x90;
const INTS = 0x98;
const PULL_UP = 1 << 16;
const BUS_RESET = 1 << 19;
const SETUP = 1 << 17;
const SUSPENDED = 1 << 4;
const RESUME = 1 << 11;
const CONNECTED = 1 << 16;
const CRC_ERROR = 1 << 24;
const BIT_STUFF_ERROR = 1 << 25;
const RX_TIMEOUT = 1 << 27;
const DATA_SEQ_ERROR = 1 << 31;
// Levels of the bus in SIE_STATUS.
const [SE0, J, K] = [0, 1 << 2, 2 << 2];
// Bits of interrupts.
const INTR_RESET = 1 << 12;
const INTR_SETUP = 1 << 16;
const INTR_BUFFER = 1 << 4;
const INTR_SUSPEND = 1 << 14;
const INTR_RESUME = 1 << 15;
// A buffer's control word.
const FULL = 1 << 15;
const DATA1 = 1 << 13;
const STALL = 1 << 11;
const AVAILABLE = 1 << 10;
const LENGTH = 0x3ff;

// A full-speed bus has time for 19 packets of 64 bytes in a millisecond.
const PACKET_NS = 1e6 / 19;
const PACKET = 64;
const FRAME_NS = 1e6;
// At power-up the computer is quick, so that tests are. Later it takes its time, as one with Linux does.
const ATTACHED_NS = 2e6;
const RESET_NS = 10e6;
const AGAIN_ATTACHED_NS = 100e6;
const AGAIN_RESET_NS = 50e6;
const RESUME_NS = 20e6;
// A bus without frames is asleep.
const ASLEEP_NS = 3e6;
// Faults of single packets: lost; damaged on the way to the device; its ACK damaged; the computer's ACK; its data.
const DAMAGES = ['token', 'crc', 'stuffing', 'answer', 'ack', 'data'];

const inControl = (endpoint) => 0x08 + 8 * (endpoint - 1);
const outControl = (endpoint) => 0x0c + 8 * (endpoint - 1);
const inBuffer = (endpoint) => 0x80 + 8 * endpoint;
const outBuffer = (endpoint) => 0x84 + 8 * endpoint;

const setup = (type, request, value, index, length, data) => ({
  packet: [type, request, value & 0xff, value >> 8, index & 0xff, index >> 8, length & 0xff, length >> 8], length, data,
});
const describe = (kind, length) => setup(0x80, 6, kind << 8, 0, length);
const LINE_CODING = [0x00, 0xc2, 0x01, 0x00, 0, 0, 8];

// The computer: which requests it makes, and the bytes of its program.
export class Computer {
  constructor(onByte) {
    this.onByte = onByte;
    this.bytes = [];
    // The program has the port open, and takes what comes.
    this.open = true;
    this.reads = true;
    this.attached = 0;
    // Packets that the device had no room for when they were due.
    this.naks = 0;
    // Requests to be made, and what came of those that have been: the answer, or 'stall'.
    this.asks = [];
    this.answered = [];
    // Bytes that were dropped because the device was gone.
    this.lost = 0;
  }
  // Has another request made: the eight bytes of its packet.
  ask(packet) {
    this.asks.push({ packet, length: packet[0] & 0x80 ? packet[6] | packet[7] << 8 : 0, mayFail: true });
  }
  // The device is gone, or its bus has been reset.
  lose() {
    this.lost += this.bytes.length;
    this.bytes.length = 0;
    this.ready = false;
  }
  // A device has been found.
  begin() {
    this.attached++;
    this.ready = false;
    this.device = undefined;
    this.endpoints = undefined;
    this.told = undefined;
  }
  // Requests until the port can be talked to, each when the one before has been answered.
  *requests() {
    this.device = yield describe(1, 18);
    yield setup(0x00, 5, 1, 0, 0);
    const head = yield describe(2, 9);
    const all = yield describe(2, head[2] | head[3] << 8);
    this.descriptors = all;
    this.endpoints = endpointsOf(all);
    yield setup(0x00, 9, 1, 0, 0);
    yield setup(0x21, 0x20, 0, 0, 7, LINE_CODING);
    this.ready = true;
    for (;;) {
      const ask = this.asks.shift();
      if (ask) this.answered.push((yield ask) ?? 'stall');
      else if (this.told === this.open) yield undefined;
      else yield setup(0x21, 0x22, (this.told = this.open) ? 3 : 0, 0, 0);
    }
  }
}

// The bulk endpoints of the interface with data.
function endpointsOf(descriptors) {
  const found = {};
  let isData = false;
  for (let at = 0; at < descriptors.length; at += descriptors[at]) {
    const [, kind, address, attributes] = descriptors.slice(at);
    if (kind === 4) isData = descriptors[at + 5] === 10;
    if (kind === 5 && isData && (attributes & 3) === 2) found[address & 0x80 ? 'in' : 'out'] = address & 0xf;
  }
  if (!found.in || !found.out) throw new Error(`no bulk endpoints in ${descriptors}`);
  return found;
}

export class Usb extends BasePeripheral {
  constructor(mcu, computer) {
    super(mcu, 'USB');
    this.computer = computer;
    this.registers = new Map();
    this.sieStatus = 0;
    this.buffStatus = 0;
    this.toggles = new Map();
    this.alarm = mcu.clock.createAlarm(() => this.due());
    this.isDue = false;
    this.isPlugged = true;
    // How many times the bus has changed: what was planned before counts no more.
    this.changes = 0;
    this.frames = 0;
    // Faults that wait for their packets, by kind; and a random number that makes others.
    this.damages = new Map();
    this.hangs = 0;
  }

  get memory() { return this.rp2040.usbDPRAMView; }
  get(offset) { return this.registers.get(offset) ?? 0; }
  get intr() {
    return (this.sieStatus & SUSPENDED && INTR_SUSPEND) | (this.sieStatus & RESUME && INTR_RESUME)
      | (this.sieStatus & BUS_RESET && INTR_RESET) | (this.sieStatus & SETUP && INTR_SETUP) | (this.buffStatus && INTR_BUFFER);
  }
  update() { this.rp2040.setInterrupt(IRQ, !!(this.intr & this.get(INTE))); }

  readUint32(offset) {
    switch (offset) {
      case SIE_STATUS: return (this.sieStatus | this.level() | (this.isCounting() && CONNECTED)) >>> 0;
      case SOF_RD: return this.frame();
      case BUFF_STATUS: return this.buffStatus;
      case INTR: return this.intr;
      case INTS: return this.intr & this.get(INTE);
    }
    return this.get(offset);
  }

  writeUint32(offset, value) {
    if (offset === SIE_STATUS) this.sieStatus &= ~this.rawWriteValue;
    else if (offset === BUFF_STATUS) this.buffStatus &= ~this.rawWriteValue;
    else this.registers.set(offset, value);
    if (offset === SIE_CTRL) this.pull(!!(value & PULL_UP));
    this.update();
    this.wake();
  }

  // A word of the memory with buffers has been written.
  DPRAMUpdated() { this.wake(); }

  // The unit is reset. Its memory stays.
  resetUnit() {
    this.stopFrames();
    this.registers.clear();
    [this.sieStatus, this.buffStatus, this.frames] = [0, 0, 0];
    this.isHung = false;
    this.pull(false);
    this.update();
  }

  // The pull-up is switched.
  pull(on) {
    if (on && !this.state && this.isPlugged) this.attach();
    if (!on && this.state) this.leave();
  }

  attach() {
    this.change('attached');
    if (this.isKnown) this.later(ASLEEP_NS, () => this.signal(SUSPENDED));
    this.after(this.isKnown ? AGAIN_ATTACHED_NS : ATTACHED_NS);
  }

  // The computer sees no device any more.
  leave() {
    this.change(undefined);
    this.computer.lose();
  }

  change(state) {
    this.changes++;
    this.stopFrames();
    this.state = state;
    this.alarm.cancel();
    this.isDue = false;
  }

  // Does something later, if the bus has not changed until then.
  later(nanos, act) {
    const { changes } = this;
    this.rp2040.clock.createAlarm(() => { if (this.changes === changes) act(); }).schedule(nanos);
  }

  // The level of the bus between packets.
  level() {
    if (!(this.get(SIE_CTRL) & PULL_UP) || this.state === 'reset') return SE0;
    return this.state === 'resuming' ? K : J;
  }

  isCounting() { return this.framesFrom !== undefined; }
  frame() {
    const now = this.isCounting() ? Math.floor((this.rp2040.clock.nanos - this.framesFrom) / FRAME_NS) : 0;
    return this.frames + now & 0x7ff;
  }
  stopFrames() {
    this.frames = this.frame();
    this.framesFrom = undefined;
  }
  startFrames() { if (!this.isHung) this.framesFrom = this.rp2040.clock.nanos; }

  // What the bus signals.
  signal(bit) {
    if (this.isHung) return;
    this.sieStatus |= bit;
    this.update();
  }

  // The computer sends nothing any more for some time, and then what `then` does.
  silence(state, nanos, then) {
    this.change(state);
    if (nanos > ASLEEP_NS) this.later(ASLEEP_NS, () => this.signal(SUSPENDED));
    this.later(nanos, then);
  }

  // The computer sleeps. Without a state in which it could, nothing happens; the same is so below.
  sleep(nanos) {
    if (this.state !== 'running') return;
    this.silence('asleep', nanos, () => {
      this.change('resuming');
      this.signal(RESUME);
      this.later(RESUME_NS, () => this.goOn());
    });
  }

  // Frames fail to come for some time; more than 3 ms of it is a sleep without a resume.
  skip(nanos) {
    if (this.state === 'running') this.silence('silent', nanos, () => this.goOn());
  }

  goOn() {
    this.change('running');
    this.startFrames();
    this.after(PACKET_NS);
  }

  // The cable comes out, and in again.
  unplug(nanos) {
    if (this.state) this.leave();
    this.isPlugged = false;
    this.silence(undefined, nanos, () => {
      this.isPlugged = true;
      this.pull(!!(this.get(SIE_CTRL) & PULL_UP));
    });
  }

  // The computer resets the bus.
  resetBus() {
    if (this.state !== 'running') return;
    this.computer.lose();
    this.beginReset();
  }

  beginReset() {
    this.change('reset');
    this.signal(BUS_RESET);
    this.after(this.isKnown ? AGAIN_RESET_NS : RESET_NS);
    this.isKnown = true;
  }

  // The computer makes a request, and gives it up at once by a reset of the bus.
  abort() {
    if (this.state !== 'running' || this.isHung || this.request) return;
    this.request = { ...describe(1, 18), stage: 'setup', answer: [], sent: 0 };
    this.control(this.request);
    this.request.stage = 'given up';
    this.later(2 * PACKET_NS, () => this.resetBus());
  }

  // The next packets are damaged in this way; `hang` is E15.
  damage(kind, count) {
    if (kind !== 'hang' && !DAMAGES.includes(kind)) throw new Error(`no fault ${kind}`);
    this.damages.set(kind, count);
  }

  // One in so many packets is damaged, by a seed; none with 0.
  noise(seed, oneIn) { [this.random, this.oneIn] = [seed, oneIn]; }

  // Whether a packet is damaged in this way.
  isDamaged(kind) {
    const left = this.damages.get(kind) ?? 0;
    if (left > 0) this.damages.set(kind, left - 1);
    return left > 0 || (kind !== 'hang' && this.oneIn > 0 && this.draw() % (this.oneIn * 3) === 0);
  }
  // Mulberry32.
  draw() {
    this.random = this.random + 0x6d2b79f5 | 0;
    let t = Math.imul(this.random ^ this.random >>> 15, 1 | this.random);
    t = t + Math.imul(t ^ t >>> 7, 61 | t) ^ t;
    return (t ^ t >>> 14) >>> 0;
  }

  // Whether a packet to the device is lost, or damaged so that the device does not answer.
  isSpoiltOut() {
    if (this.isDamaged('token')) return true;
    if (this.isDamaged('crc')) this.sieStatus |= CRC_ERROR;
    else if (this.isDamaged('stuffing')) this.sieStatus |= BIT_STUFF_ERROR;
    else return false;
    return true;
  }
  // Whether a packet of the device gets no ACK, because it is damaged, or because the device takes another one for the ACK and hangs.
  isSpoiltIn() {
    if (this.isDamaged('hang')) {
      this.stopFrames();
      this.isHung = true;
      this.hangs++;
      return true;
    }
    if (!this.isDamaged('data')) return false;
    this.sieStatus |= RX_TIMEOUT;
    return true;
  }

  after(nanos) {
    this.isDue = true;
    this.alarm.schedule(nanos);
  }

  // There may be something to do on the bus.
  wake() {
    if (this.state === 'running' && !this.isDue) this.after(PACKET_NS);
  }

  due() {
    this.isDue = false;
    if (this.state === 'attached') {
      this.beginReset();
    } else if (this.state === 'reset') {
      if (this.sieStatus & BUS_RESET) throw new Error('the device does not see the reset of its bus');
      this.toggles.clear();
      [this.sentAgain, this.heardAgain] = [false, false];
      this.computer.begin();
      this.steps = this.computer.requests();
      this.next(undefined);
      this.goOn();
    } else if (this.state === 'running' && this.transact()) {
      this.after(PACKET_NS);
    }
  }

  next(answer) {
    this.request = this.steps.next(answer).value;
    if (this.request) Object.assign(this.request, { stage: 'setup', answer: [], sent: 0 });
  }

  // One packet. False if there is none: the device is asked again when it has changed something.
  transact() {
    const { computer } = this;
    // Nobody answers: the computer goes on with its frames.
    if (this.isHung) return false;
    if (!this.request) this.next(undefined);
    if (this.request && this.control(this.request)) return true;
    if (!computer.ready) return false;
    // What is said comes first, in turns with what is heard.
    this.turn = !this.turn;
    const ways = [() => this.say(), () => this.hear()];
    return this.turn ? ways[0]() || ways[1]() : ways[1]() || ways[0]();
  }

  control(request) {
    switch (request.stage) {
      case 'given up':
        return false;
      case 'setup':
        if (this.isSpoiltOut()) return true;
        // One that comes ends what was before.
        for (const at of [inBuffer(0), outBuffer(0)]) this.memory.setUint32(at, this.memory.getUint32(at, true) & ~(AVAILABLE | STALL), true);
        this.registers.set(EP_STALL_ARM, 0);
        request.packet.forEach((byte, i) => this.memory.setUint8(i, byte));
        this.toggles.set('in0', DATA1).set('out0', DATA1);
        this.sieStatus |= SETUP;
        this.update();
        request.stage = request.data ? 'out' : request.length ? 'in' : 'acknowledge';
        return true;
      case 'in': {
        if (this.isRefused(request)) return true;
        if (!this.isOffered(0)) return false;
        if (this.isSpoiltIn()) return true;
        const bytes = this.takeIn(0);
        request.answer.push(...bytes);
        if (bytes.length < PACKET || request.answer.length >= request.length) request.stage = 'end';
        return true;
      }
      case 'end':
        this.toggles.set('out0', DATA1);
        if (!this.putOut(0, [])) return false;
        this.next(request.answer);
        return true;
      case 'out':
        if (!this.putOut(0, request.data)) return false;
        request.stage = 'acknowledge';
        return true;
      default: {
        if (this.isRefused(request)) return true;
        this.toggles.set('in0', DATA1);
        if (!this.isOffered(0)) return false;
        if (this.isSpoiltIn()) return true;
        this.takeIn(0);
        this.next([]);
        return true;
      }
    }
  }

  // Whether a request is refused, which only some may be.
  isRefused(request) {
    if (!(this.memory.getUint32(inBuffer(0), true) & STALL && this.get(EP_STALL_ARM))) return false;
    if (!request.mayFail) throw new Error('a request is refused');
    this.next(undefined);
    return true;
  }

  say() {
    const { computer } = this;
    if (!(computer.bytes.length || this.sentAgain) || !computer.open) return false;
    const { out } = computer.endpoints;
    if (!this.isReady(out)) {
      computer.naks++;
      return false;
    }
    if (this.isSpoiltOut()) return true;
    if (this.sentAgain) {
      // The device has it already, but the computer has not seen its ACK.
      this.sieStatus |= DATA_SEQ_ERROR;
      this.sentAgain = false;
    } else {
      this.putOut(out, computer.bytes.splice(0, PACKET));
      this.sentAgain = this.isDamaged('answer');
    }
    return true;
  }

  hear() {
    const { computer } = this;
    if (!computer.reads || !computer.open) return false;
    const endpoint = computer.endpoints.in;
    if (!this.isOffered(endpoint)) return false;
    if (this.isSpoiltIn()) return true;
    const isNew = !this.heardAgain;
    if (isNew && this.isDamaged('ack')) {
      // The device sends the packet again; the computer knows it by its number.
      this.heardAgain = true;
      this.sieStatus |= RX_TIMEOUT;
      this.bytesIn(endpoint).forEach((byte) => computer.onByte(byte));
      return true;
    }
    this.heardAgain = false;
    const bytes = this.takeIn(endpoint);
    if (isNew) bytes.forEach((byte) => computer.onByte(byte));
    return true;
  }

  // Where an endpoint's buffer is.
  place(endpoint, control) {
    if (endpoint === 0) return 0x100;
    const word = this.memory.getUint32(control, true);
    return word >>> 31 ? word & 0xffc0 : undefined;
  }

  // Data come as DATA0 and DATA1 in turns.
  toggle(name, word) {
    const wanted = this.toggles.get(name) ?? 0;
    if ((word & DATA1) !== wanted) throw new Error(`packets of ${name} out of turn`);
    this.toggles.set(name, wanted ^ DATA1);
  }

  // Whether the device has something for the computer, and whether it takes something.
  isOffered(endpoint) {
    return !!(this.memory.getUint32(inBuffer(endpoint), true) & AVAILABLE) && this.place(endpoint, inControl(endpoint)) !== undefined;
  }
  isReady(endpoint) {
    return !!(this.memory.getUint32(outBuffer(endpoint), true) & AVAILABLE) && this.place(endpoint, outControl(endpoint)) !== undefined;
  }

  bytesIn(endpoint) {
    const word = this.memory.getUint32(inBuffer(endpoint), true);
    if (!(word & FULL)) throw new Error('an empty buffer is to be sent');
    const place = this.place(endpoint, inControl(endpoint));
    return [...this.rp2040.usbDPRAM.slice(place, place + (word & LENGTH))];
  }

  // What the device has for the computer.
  takeIn(endpoint) {
    const at = inBuffer(endpoint);
    const word = this.memory.getUint32(at, true);
    const bytes = this.bytesIn(endpoint);
    this.toggle(`in${endpoint}`, word);
    this.done(at, word & ~(AVAILABLE | FULL), 2 * endpoint);
    return bytes;
  }

  // What the computer has for the device, if that takes it.
  putOut(endpoint, bytes) {
    const at = outBuffer(endpoint);
    const word = this.memory.getUint32(at, true);
    const place = this.place(endpoint, outControl(endpoint));
    if (!(word & AVAILABLE) || place === undefined) return false;
    if (bytes.length > (word & LENGTH)) throw new Error(`${bytes.length} bytes for a buffer of ${word & LENGTH}`);
    this.toggle(`out${endpoint}`, word);
    bytes.forEach((byte, i) => this.memory.setUint8(place + i, byte));
    this.done(at, word & ~(AVAILABLE | LENGTH) | FULL | bytes.length, 2 * endpoint + 1);
    return true;
  }

  done(at, word, bit) {
    this.memory.setUint32(at, word, true);
    this.buffStatus |= 1 << bit;
    this.update();
  }
}
