// The USB of the RP2040 as a device, the bus, and a computer with one program that talks to a CDC ACM port of it. That of rp2040js gives buffers back
// before anything has come, and keeps no order of packets.
import { BasePeripheral } from 'rp2040js';

const IRQ = 5;
// Registers.
const ADDR_ENDP = 0x00;
const SIE_CTRL = 0x4c;
const SIE_STATUS = 0x50;
const BUFF_STATUS = 0x58;
const EP_STALL_ARM = 0x68;
const INTR = 0x8c;
const INTE = 0x90;
const INTS = 0x98;
const PULL_UP = 1 << 16;
const BUS_RESET = 1 << 19;
const SETUP = 1 << 17;
// Bits of interrupts.
const INTR_RESET = 1 << 12;
const INTR_SETUP = 1 << 16;
const INTR_BUFFER = 1 << 4;
// A buffer's control word.
const FULL = 1 << 15;
const DATA1 = 1 << 13;
const STALL = 1 << 11;
const AVAILABLE = 1 << 10;
const LENGTH = 0x3ff;

// A full-speed bus has time for 19 packets of 64 bytes in a millisecond.
const PACKET_NS = 1e6 / 19;
const PACKET = 64;
const ATTACHED_NS = 2e6;
const RESET_NS = 10e6;

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
    this.endpoints = endpointsOf(all);
    yield setup(0x00, 9, 1, 0, 0);
    yield setup(0x21, 0x20, 0, 0, 7, LINE_CODING);
    this.ready = true;
    for (;;) {
      if (this.told === this.open) yield undefined;
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
  }

  get memory() { return this.rp2040.usbDPRAMView; }
  get(offset) { return this.registers.get(offset) ?? 0; }
  get intr() {
    return (this.sieStatus & BUS_RESET && INTR_RESET) | (this.sieStatus & SETUP && INTR_SETUP) | (this.buffStatus && INTR_BUFFER);
  }
  update() { this.rp2040.setInterrupt(IRQ, !!(this.intr & this.get(INTE))); }

  readUint32(offset) {
    switch (offset) {
      case SIE_STATUS: return this.sieStatus;
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
    if (offset === SIE_CTRL && value & PULL_UP && !this.state) this.attach();
    this.update();
    this.wake();
  }

  // A word of the memory with buffers has been written.
  DPRAMUpdated() { this.wake(); }

  attach() {
    this.state = 'attached';
    this.after(ATTACHED_NS);
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
      this.state = 'reset';
      this.sieStatus |= BUS_RESET;
      this.update();
      this.after(RESET_NS);
    } else if (this.state === 'reset') {
      if (this.sieStatus & BUS_RESET) throw new Error('the device does not see the reset of its bus');
      this.state = 'running';
      this.toggles.clear();
      this.computer.begin();
      this.steps = this.computer.requests();
      this.next(undefined);
      this.after(PACKET_NS);
    } else if (this.transact()) {
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
      case 'setup':
        // One that comes ends what was before.
        for (const at of [inBuffer(0), outBuffer(0)]) this.memory.setUint32(at, this.memory.getUint32(at, true) & ~(AVAILABLE | STALL), true);
        request.packet.forEach((byte, i) => this.memory.setUint8(i, byte));
        this.toggles.set('in0', DATA1).set('out0', DATA1);
        this.sieStatus |= SETUP;
        this.update();
        request.stage = request.data ? 'out' : request.length ? 'in' : 'acknowledge';
        return true;
      case 'in': {
        const bytes = this.takeIn(0);
        if (!bytes) return false;
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
        this.toggles.set('in0', DATA1);
        if (!this.takeIn(0)) return false;
        this.next([]);
        return true;
      }
    }
  }

  say() {
    const { computer } = this;
    if (!computer.bytes.length || !computer.open) return false;
    if (!this.putOut(computer.endpoints.out, computer.bytes.slice(0, PACKET))) {
      computer.naks++;
      return false;
    }
    computer.bytes.splice(0, PACKET);
    return true;
  }

  hear() {
    const { computer } = this;
    if (!computer.reads || !computer.open) return false;
    const bytes = this.takeIn(computer.endpoints.in);
    bytes?.forEach((byte) => computer.onByte(byte));
    return !!bytes;
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

  // What the device has for the computer.
  takeIn(endpoint) {
    const at = inBuffer(endpoint);
    const word = this.memory.getUint32(at, true);
    if (endpoint === 0 && word & STALL && this.get(EP_STALL_ARM)) throw new Error('a request is refused');
    const place = this.place(endpoint, inControl(endpoint));
    if (!(word & AVAILABLE) || place === undefined) return undefined;
    if (!(word & FULL)) throw new Error('an empty buffer is to be sent');
    this.toggle(`in${endpoint}`, word);
    const bytes = [...this.rp2040.usbDPRAM.slice(place, place + (word & LENGTH))];
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
