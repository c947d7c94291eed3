// node bridge.mjs: a board for a program that talks to it over standard input and output. Each line of the input is a request in JSON, each line of the output its answer:
//
//   {"board": {"elf": "file", "motors": [[step, dir], ...]}, "cells": "hex", "send": [[line, "hex"]], "now": [[line, byte]], "baud": [[line, rate]], "drive": [[pin, high]], "wire": [...], "spindle": {"index": pin, "sync": pin, "pulses": n}, "turn": rpm, "record": true, "cut": 0 to 3, "until": cycle, "line": true}
//
// `board` comes first, and again where another board is to take the place of the one before. `cells` are the contents of its EEPROM. With `record` the times of steps are
// kept from there on, and told with the next request that has it. The board runs to the cycle, or, with `line`, to the end of the next line that it says; with `cut` the
// answer has what is left in the EEPROM if the supply fails then.
import { createInterface } from 'node:readline';
import { load } from './machine.mjs';
import { Spindle } from './pins.mjs';

let machine;

function act(request) {
  if (request.board) machine = load(request.board.elf, request.board.motors);
  if (request.cells) machine.cells.memory.set(Buffer.from(request.cells, 'hex'));
  for (const [pin, high] of request.drive ?? []) machine.drive(pin, high);
  for (const [line, rate] of request.baud ?? []) machine.lines[line].bit = 16e6 / rate;
  for (const [line, hex] of request.send ?? []) machine.lines[line].send(Buffer.from(hex, 'hex'));
  for (const [line, byte] of request.now ?? []) machine.lines[line].sendNow(byte);
  if (request.wire) machine.motors.wire(request.wire);
  if (request.spindle) machine.fit(new Spindle(request.spindle));
  if (request.turn !== undefined) machine.spindle.turn(request.turn, machine.cpu.cycles);
  const { times } = machine.motors;
  if (request.record) machine.motors.record();
  machine.runUntil(request.until, request.line);
  return request.record ? times : undefined;
}

const hex = (bytes) => Buffer.from(bytes).toString('hex');

function answer(request, times) {
  const heard = machine.lines.map((line) => hex(line.heard));
  machine.lines.forEach((line) => { line.heard.length = 0; });
  const { cpu, motors, cells, resets, uarts } = machine;
  return {
    cycle: cpu.cycles,
    heard,
    steps: motors.positions,
    totals: motors.totals,
    last: motors.last,
    lost: uarts.reduce((sum, uart) => sum + uart.lost, 0),
    resets,
    times,
    cells: request.cut === undefined ? undefined : hex(cells.left(request.cut)),
  };
}

for await (const line of createInterface({ input: process.stdin })) {
  let result;
  try {
    const request = JSON.parse(line);
    result = answer(request, act(request));
  } catch (error) {
    result = { fault: String(error.stack ?? error) };
  }
  process.stdout.write(`${JSON.stringify(result)}\n`);
}
