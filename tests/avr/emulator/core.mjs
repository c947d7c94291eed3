// The CPU of avr8js, put right, and faster: its one function for all instructions tries a hundred conditions in turn, and is taken apart here into a function
// for each. The text of a function of avr8js is changed where it contradicts the data sheet of the ATmega2560 or the manual of the instruction set ("manual").
import avr8js from 'avr8js';

const { CPU, avrInstruction, avrInterrupt } = avr8js;

// Status register, and its interrupt enable.
export const SREG = 0x5f;
const I = 0x80;
// SMCR, and its sleep enable.
const SMCR = 0x53;
const SE = 1;
// Registers and RAM: the data space ends at 0x21ff (8.3).
const DATA_END = 0x2200;
// avr8js counts 0x100 of them itself.
const COUNTED = 0x100;
// Cycles from an interrupt until its vector runs: five with a program counter of three bytes (7.8), of which avr8js takes two. From sleep four more.
const ENTRY = 5;
const OF_AVR8JS = 2;
const WAKE = 4;

// What is changed in the instructions: instructions by the names that avr8js gives them, text, and what stands there instead.
const CURES = [
  // Manual: H is the carry from bit 3. avr8js takes bit 0.
  [['ADC', 'ADD', 'CP', 'CPC', 'CPI', 'NEG', 'SBC', 'SBCI', 'SUB', 'SUBI'], 'sreg |= 1 & (', 'sreg |= 8 & ('],
  // Manual: V is set by the negation of 0x80. In avr8js the result is -128 there, and never 128.
  [['NEG'], '128 === R', '128 === value'],
  // Manual: Z stays where the byte is 0. In avr8js 0 - 255 - 1 is -256, and not 0.
  [['CPC'], '!r &&', '!(r & 255) &&'],
  [['SBC', 'SBCI'], '!R &&', '!(R & 255) &&'],
  // Manual: Z is set where the product is 0. avr8js sets it elsewhere.
  [['FMULSU'], '0xffff & R ? 2 : 0', '0xffff & R ? 0 : 2'],
  // Manual: CBI takes two cycles. In avr8js one.
  [['CBI'], 'cpu.writeData(', 'cpu.cycles++;cpu.writeData('],
  // 7.5: three bytes of return address. In avr8js a return to 0x10000 or 0x20000 goes to 0, because it has subtracted 1 from the low bytes before.
  [['RET', 'RETI'], 'cpu.pc |=', 'cpu.pc +='],
  // 11.1: SLEEP stops the CPU if SE is set. avr8js goes on.
  [['SLEEP'], '/* not implemented */', `if (cpu.data[${SMCR}] & ${SE}) cpu.asleep = true;`],
];

// LDS, STS, CALL and JMP, which a skip goes over.
const isTwoWords = (opcode) => (opcode & 0xfc0f) === 0x9000 || (opcode & 0xfe0c) === 0x940c;

// The instructions of avr8js: name, condition and body of each, in the order in which they are tried.
function instructions() {
  const branch = /\n    (?:else )?if \(([^]*?)\) \{\n([^]*?)\n    \}(?=\n)/g;
  return [...avrInstruction.toString().matchAll(branch)].map(([, condition, body]) => {
    const [, name] = body.match(/\/\* ([^,]+),/);
    const cures = CURES.filter(([names]) => names.includes(name));
    for (const [, from, to] of cures) {
      if (body.split(from).length !== 2) throw new Error(`avr8js has another ${name}: no cure for it`);
      body = body.replace(from, () => to);
    }
    return { name, condition, body };
  });
}

const END = 'cpu.pc = (cpu.pc + 1) % cpu.progMem.length; cpu.cycles++;';

// A function for each instruction, and the one that belongs to each opcode. What is no instruction throws.
function table() {
  const all = instructions();
  const names = all.map(({ name }) => name);
  for (const name of CURES.flatMap(([known]) => known)) if (!names.includes(name)) throw new Error(`avr8js has no ${name}`);
  const functions = all.map(({ body }) => new Function('isTwoWordInstruction', `return (cpu, opcode) => {${body}\n${END}}`)(isTwoWords));
  const index = new Function('opcode', `${all.map(({ condition }, i) => `if (${condition}) return ${i};`).join('')} return -1;`);
  const none = (cpu, opcode) => { throw new Error(`no instruction ${opcode.toString(16)} at ${(2 * cpu.pc).toString(16)}`); };
  return Array.from({ length: 0x10000 }, (_, opcode) => functions[index(opcode)] ?? none);
}

const TABLE = table();

export class Core extends CPU {
  constructor(flash) {
    super(flash, DATA_END - COUNTED);
    this.readHooks = new Array(DATA_END).fill(undefined);
    this.writeHooks = new Array(DATA_END).fill(undefined);
    this.code = Array.from(flash, (opcode) => TABLE[opcode]);
    this.asleep = false;
  }

  // The cycle at which the store takes effect that is being executed: behind one cycle of OUT, and two of others.
  get stores() { return this.cycles + ((this.progMem[this.pc] & 0xf000) === 0xb000 ? 1 : 2); }

  // Runs to a cycle, or until `ends` after an event.
  runUntil(limit, ends) {
    while (this.cycles < limit) if (this.step(limit) && ends()) return;
  }

  // Executes an instruction, or sleeps to an event, and enters an interrupt. Whether there was an event.
  step(limit) {
    const wasOn = this.data[SREG] & I;
    if (this.asleep) {
      this.sleep(limit);
    } else {
      const { pc } = this;
      this.code[pc](this, this.progMem[pc]);
    }
    const isEvent = this.nextClockEvent !== null && this.nextClockEvent.cycles <= this.cycles;
    if (isEvent) this.passEvents();
    // 7.8: an instruction is executed behind SEI and behind RETI before an interrupt is served. In avr8js none is.
    if (this.nextInterrupt >= 0 && wasOn && this.data[SREG] & I) this.enter();
    return isEvent;
  }

  sleep(limit) {
    if (!(this.data[SREG] & I)) throw new Error('sleeps with interrupts off');
    this.cycles = Math.max(this.cycles, Math.min(limit, this.nextClockEvent?.cycles ?? Infinity));
  }

  // All that is due. avr8js takes one event an instruction.
  passEvents() {
    for (let event; (event = this.nextClockEvent) !== null && event.cycles <= this.cycles;) {
      this.nextClockEvent = event.next;
      event.callback();
      this.clockEventPool.push(event);
    }
  }

  enter() {
    const interrupt = this.pendingInterrupts[this.nextInterrupt];
    avrInterrupt(this, interrupt.address);
    this.cycles += ENTRY - OF_AVR8JS + (this.asleep ? WAKE : 0);
    this.asleep = false;
    if (!interrupt.constant) this.clearInterrupt(interrupt);
    interrupt.served?.();
  }

  // An interrupt that is a level: whether its condition holds and it is enabled.
  ask(interrupt, asks) {
    if (asks) this.queueInterrupt(interrupt);
    else this.clearInterrupt(interrupt, false);
  }
}
