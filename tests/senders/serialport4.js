// The serial port as `g2core-api` knows it (version 4, which no longer builds), made of version 10.

'use strict';

const Module = require('module');
const installed = require('./installed');

const { SerialPort } = installed('serialport10');

/// Opens at once; what comes in goes through the parser in the options, which makes `data` of it.
class OldSerialPort extends SerialPort {
  constructor(path, options) {
    super({ path, baudRate: options.baudRate, rtscts: false });
    this.parse = options.parser;
  }

  emit(event, ...args) {
    // The parser emits `data` itself, as text: that is to pass.
    if (event !== 'data' || !this.parse || typeof args[0] === 'string') return super.emit(event, ...args);
    this.parse(this, args[0]);
    return true;
  }
}

/// From now on `serialport` is the old one.
const load = Module._load;
Module._load = (name, ...rest) => (name === 'serialport' ? OldSerialPort : load(name, ...rest));
