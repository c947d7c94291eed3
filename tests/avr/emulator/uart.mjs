// A USART as an asynchronous port, in place of that of avr8js, which has no buffers, and whose lines take no time.
//
// Data sheet, 22.6: UDR is a buffer before the shift register of the transmitter. UDRE says that the buffer is empty, and is cleared by writing UDR alone.
// avr8js clears it where its interrupt is entered, and has it set when the byte has been sent. 22.7: behind the shift register of the receiver there is a FIFO of two
// bytes, and RXC stays while there is one; nothing is lost by writing UCSRB. avr8js has no FIFO, and drops a byte there.
const [RXC, TXC, UDRE, FE, DOR, U2X, MPCM] = [0x80, 0x40, 0x20, 0x10, 0x08, 0x02, 0x01];
// In UCSRB; each interrupt is enabled by the bit that its flag has in UCSRA.
const [RXEN, TXEN] = [0x10, 0x08];
const USBS = 0x08;
const UPM1 = 0x20;
// Registers behind UCSRA.
const [UCSRB, UCSRC, UBRRL, UBRRH, UDR] = [1, 2, 4, 5, 6];
const DEPTH = 2;
// From this mismatch of rates on bytes are not understood.
const GARBLES = 0.045;

export class Uart {
  // Its first register, and the number of its first vector.
  constructor(cpu, [base, vector]) {
    Object.assign(this, { cpu, base, fifo: [], receiving: undefined, waiting: undefined, sending: undefined, buffered: undefined });
    this.lost = 0;
    this.sent = () => {};
    const { data, readHooks, writeHooks } = cpu;
    data[base] = UDRE;
    data[base + UCSRC] = 0x06;
    const source = (n, constant) => ({ address: 2 * (vector + n), flagRegister: base, flagMask: 0, constant });
    this.interrupts = [[RXC, source(0, true)], [UDRE, source(1, true)], [TXC, source(2, true)]];
    // 22.11.2: TXC is cleared when its interrupt is executed; the others are conditions.
    this.interrupts[2][1].served = () => { data[base] &= ~TXC; this.ask(); };
    this.complete = () => this.received();
    this.through = () => this.shifted();
    readHooks[base + UDR] = () => this.read();
    writeHooks[base] = (value) => {
      data[base] = data[base] & ~(U2X | MPCM) & ~(value & TXC) | value & (U2X | MPCM);
      this.ask();
      return true;
    };
    writeHooks[base + UCSRB] = (value) => {
      data[base + UCSRB] = value;
      if (!(value & RXEN)) this.deafen();
      this.ask();
      return true;
    };
    writeHooks[base + UDR] = (value) => { this.write(value); return true; };
  }

  // The interrupts whose flags are set and enabled.
  ask() {
    const { data } = this.cpu;
    const active = data[this.base] & data[this.base + UCSRB];
    for (const [flag, interrupt] of this.interrupts) this.cpu.ask(interrupt, active & flag);
  }

  get bit() {
    const { data } = this.cpu;
    const divisor = data[this.base + UBRRL] | (data[this.base + UBRRH] & 0x0f) << 8;
    return (divisor + 1) * (data[this.base] & U2X ? 8 : 16);
  }

  get bits() {
    const { data } = this.cpu;
    const format = data[this.base + UCSRC];
    const size = [5, 6, 7, 8, 8, 8, 8, 9][format >> 1 & 3 | data[this.base + UCSRB] & 4];
    return 1 + size + (format & UPM1 ? 1 : 0) + (format & USBS ? 2 : 1);
  }

  // A start bit comes, of a sender with so many cycles a bit.
  start(byte, bit, now) {
    const { cpu, bits } = this;
    if (!(cpu.data[this.base + UCSRB] & RXEN) || this.receiving) return;
    // 22.7.4: the third byte waits in the shift register, and is lost when another one starts.
    const overrun = this.waiting ? DOR : 0;
    if (overrun) this.lost++;
    this.waiting = undefined;
    const broken = Math.abs(this.bit - bit) > bit * GARBLES;
    this.receiving = { byte: broken ? ~byte & 0xff : byte, errors: overrun | (broken ? FE : 0) };
    // In the middle of the stop bit.
    cpu.addClockEvent(this.complete, now + Math.floor(this.bit * (2 * bits - 1) / 2) - cpu.cycles);
  }

  received() {
    this.waiting = this.receiving;
    this.receiving = undefined;
    this.settle();
  }

  settle() {
    const { data } = this.cpu;
    if (this.waiting && this.fifo.length < DEPTH) {
      this.fifo.push(this.waiting);
      this.waiting = undefined;
    }
    const [first] = this.fifo;
    data[this.base] = data[this.base] & ~(RXC | FE | DOR) | (first ? RXC | first.errors : 0);
    this.ask();
  }

  read() {
    const byte = this.fifo.shift()?.byte ?? 0;
    this.settle();
    return byte;
  }

  // 22.7.6: a receiver that is switched off has nothing.
  deafen() {
    this.fifo = [];
    this.waiting = undefined;
    if (this.receiving) this.cpu.clearClockEvent(this.complete);
    this.receiving = undefined;
    this.cpu.data[this.base] &= ~(RXC | FE | DOR);
  }

  write(byte) {
    const { cpu, base } = this;
    if (!(cpu.data[base + UCSRB] & TXEN)) return;
    if (this.sending === undefined) {
      this.begin(byte, cpu.stores);
    } else if (this.buffered === undefined) {
      this.buffered = byte;
      cpu.data[base] &= ~UDRE;
      this.ask();
    } else {
      throw new Error('a byte was written to a transmitter that had no room');
    }
  }

  begin(byte, now) {
    this.sending = byte;
    this.done = now + this.bit * this.bits;
    this.cpu.addClockEvent(this.through, this.done - this.cpu.cycles);
  }

  // A byte has left.
  shifted() {
    const { data } = this.cpu;
    const byte = this.sending;
    this.sending = undefined;
    if (this.buffered === undefined) data[this.base] |= TXC;
    else this.begin(this.buffered, this.done);
    this.buffered = undefined;
    data[this.base] |= UDRE;
    this.ask();
    this.sent(byte);
  }
}
