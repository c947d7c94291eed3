//! The settings of the machine itself.

use super::group;

group! {
    /// The group `sys`.
    system: i32, DEFAULT.system => {
        FB "fb": constant(2), 44_020,
            bare(text!("firmware build")),
            "Build number of the firmware whose protocol Kerf speaks.";
        FV "fv": constant(3), 970,
            bare(text!("firmware version")).with_decimals(2),
            "Version number of the firmware whose protocol Kerf speaks.";
        HP "hp": constant(0), 1,
            bare(text!("hardware platform")).with_decimals(2),
            "Hardware platform number.";
        HV "hv": constant(0), 8,
            bare(text!("hardware version")).with_decimals(2),
            "Hardware version number.";
        ID "id": fixed_text(false), 0,
            bare(text!("TinyG ID")),
            "Board ID.";
        JA "ja": fixed(2, 0, POSITIVE).with(UNIT), 10_000_000,
            length(text!("junction acceleration"), NONE),
            "Junction acceleration: maximum centripetal acceleration in a corner. A larger value makes corners faster.";
        CT "ct": fixed(6, 4, 1_000).with(UNIT), 10_000,
            length(text!("chordal tolerance"), NONE),
            "Chordal tolerance: maximum distance between an arc and the chords that approximate it. Chords are not made shorter than 0.02 mm for it.";
        SL "sl": int(0, 1), 0,
            bare(text!("soft limit enable")),
            "Soft limits. 1: a move of a homed axis beyond `tn` or `tm` is refused with status 220. 0: no soft limits.";
        ST "st": int(0, 1), 0,
            words(text!("switch type"), text!(" [0=NO,1=NC]")),
            "Type of all limit and homing switches: normally open (NO) or normally closed (NC). The probe is always normally open.";
        MT "mt": up_to(fixed(2, 2, 10), 429_496_700).with(CLAMP), 200,
            words(text!("motor idle timeout"), text!(" Sec")),
            "Motor idle timeout: time from the last move until motors with `pm` 2 or 3 lose power. Time in a feedhold does not count.";
        EJ "ej": int(0, 2), 1,
            words(text!("enable json mode"), text!(" [0=text,1=JSON]")),
            "Text mode or JSON mode at power-up. After that, G-code is answered in the mode of the last line that began with `{`, `$`, `?` or `h`. 2 has an effect only with `dia` 1: lines in text mode are answered as plain text, not as JSON with `txt`.";
        JV "jv": int(0, 5), 3,
            words(text!("json verbosity"), text!(" [0=silent,1=footer,2=messages,3=configs,4=linenum,5=verbose]")),
            "JSON verbosity: what JSON responses contain. Each level adds to the level below it.";
        JS "js": int(0, 1), 1,
            words(text!("json serialize style"), text!(" [0=relaxed,1=strict]")),
            "JSON syntax of what Kerf sends: strict puts keys in quotes, relaxed does not.";
        TV "tv": int(0, 1), 1,
            words(text!("text verbosity"), text!(" [0=silent,1=verbose]")),
            "Text verbosity: whether a prompt answers each line in text mode.";
        QV "qv": int(0, 3), 0,
            words(text!("queue report verbosity"), text!(" [0=off,1=single,2=triple]")),
            "Queue reports. Single has the number of free blocks. Triple also has the numbers of blocks added and removed. 3 acts as 2.";
        SV "sv": int(0, 2), 1,
            words(text!("status report verbosity"), text!(" [0=off,1=filtered,2=verbose]")),
            "Automatic status reports. Filtered has only the values that have changed. Verbose has all values.";
        SI "si": up_to(fixed(0, 0, 100), 65_535).with(CLAMP), 500,
            words(text!("status interval"), text!(" ms")),
            "Minimum time between automatic status reports. A change of the machine state is reported at once.";
        EC "ec": int(0, 1), 0,
            words(text!("expand LF to CRLF on TX"), OFF_ON),
            "Line end in what Kerf sends: LF if off, LF CR if on.";
        EE "ee": int(0, 1), 0,
            words(text!("enable echo"), OFF_ON),
            "Echo. 1: each received line is sent back as a line of its own, before its response.";
        EX "ex": int(0, if ACTIVE.has_handshake() { 2 } else { 1 }), 1,
            words(text!("enable flow control"), text!(" [0=off,1=XON/XOFF,2=RTS/CTS]")),
            "Flow control, in both directions. 2 needs a board with RTS and CTS pins.";
        RXM "rxm": int(0, 1), 1,
            words(text!("serial RX mode"), text!(" [0=char_mode,1=line_mode]")),
            "What the sender counts to limit unanswered input. line_mode: at most 4 lines. char_mode: at most 254 characters (62 on the second port).";
        BAUD "baud": up_to(fixed(0, 0, 1), 1_000_000).with(RANGE), 5,
            words(text!("USB baud rate"), text!(" [1=9600,2=19200,3=38400,4=57600,5=115200,6=230400]")),
            "Baud rate of the USB serial port: a code from 1 to 6, or the rate from 9600 to 1000000. The new rate applies once the response has been sent. After a reset the rate is 115200. Above 500000, lines may be refused with status 13 while motors move.";
        NET "net": constant(0), 0,
            words(text!("network mode"), text!(" [0=master]")),
            "Network mode. Kerf does not support a network of boards; the value is always 0.";
        GPL "gpl": int(0, 2), 0,
            words(text!("default gcode plane"), text!(" [0=G17,1=G18,2=G19]")),
            "Plane at power-up and after M2 or M30.";
        GUN "gun": int(0, 1), 1,
            words(text!("default gcode units mode"), text!(" [0=G20,1=G21]")),
            "Units at power-up and after M2 or M30.";
        GCO "gco": int(1, 9), 1,
            words(text!("default gcode coord system"), text!(" [1-9 (G54-G59.3)]")),
            "Coordinate system at power-up and after M2 or M30: 1 is G54, 6 is G59, 9 is G59.3.";
        GPA "gpa": int(0, 2), 2,
            words(text!("default gcode path control"), text!(" [0=G61,1=G61.1,2=G64]")),
            "Path control mode at power-up and after M2 or M30.";
        GDI "gdi": int(0, 1), 0,
            words(text!("default gcode distance mode"), text!(" [0=G90,1=G91]")),
            "Distance mode at power-up and after M2 or M30.";
        BD "bd": int(0, 1), 1,
            words(text!("block delete"), OFF_ON),
            "Block delete. 1: lines that begin with `/` are skipped.";
        OST "ost": int(0, 1), 1,
            words(text!("optional stop"), OFF_ON),
            "Optional stop. 1: M1 stops the program. 0: M1 has no effect.";
        PSW "psw": int(0, 1), 1,
            words(text!("program stop waits"), OFF_ON),
            "Program stop. 1: M0, M1, M6, M60 and G88 wait for `~`, and exception 38 reports the wait. 0: they do not wait. Use 0 if the sender handles stops and tool changes itself.";
        PBO "pbo": int(0, 1), 1,
            words(text!("probe backs off"), OFF_ON),
            "Probe back-off. 1: after a contact the axes return to the contact point. 0: they stay where they have stopped, beyond the contact point.";
        DIA "dia": int(0, if cfg!(feature = "dialect-reprap") { 63 } else { 15 }), ACTIVE.dialect as i32,
            words(text!("protocol dialect"), text!(" [0=auto,1=g2core,2=TinyG,3=grbl]")),
            "Protocol dialects, as a sum. First port: 0 lets the first lines decide, 1 is g2core's, 2 is TinyG's, 3 is grbl's, 16 is RepRap's. Second port: 0 is as the first port, 4 lets the first lines decide, 8 is TinyG's, 12 is grbl's, 32 is RepRap's. Example: 11 is grbl's on the first port and TinyG's on the second. Where the first lines decide, the port starts in TinyG's dialect. The first line that only one dialect has selects that dialect. g2core's is TinyG's dialect with responses that end with `[1,status,length]`, and with `fb`, `fv`, `hp`, `hv`, prompts, some status codes and some texts of g2core. RepRap's needs an image that has it. A change to 2, 3, 16 or 32 takes effect at the next reset.";
        GRM "grm": int(0, 63), 1,
            bare(text!("grbl report mask")),
            "Contents of reports in grbl's dialect, a sum. 1: machine position instead of work position. 2: free blocks and bytes. 4: inches instead of millimetres. 8: after a refused line of G-code the machine holds until `~` or a reset. 16: in a thread, status reports have `Se`, the distance by which the axes are ahead of the spindle. 32: each index pulse in a thread reports that distance, in TinyG's dialect as `spf`. grbl's setting number 10 has the values 1, 2, 16 and 32 as 1, 2, 4 and 8. Its setting number 13 has the value 4 as 1.";
        SPW "spw": int(SHORTEST_PULSE_US, 10).with(IDLE), 2,
            words(text!("step pulse width"), text!(" us")),
            "Step pulse width. A wider pulse may lower `vm` and `fr`. Boards with an RP2040 also take 0, which is 0.5 us.";
        DSU "dsu": int(0, 100).with(IDLE), 1,
            words(text!("direction setup time"), text!(" us")),
            "Direction setup time: minimum time between a change of a direction pin and the next step pulse.";
        SAF "saf": int(0, 2), 0,
            words(text!("safety door"), text!(" [0=off,1=NO,2=NC]")),
            "Safety door switch. NO closes when the door opens, NC opens when the door opens. An open door causes a feedhold. `~` resumes once the door is shut.";
        EST "est": int(0, 2), 0,
            words(text!("emergency stop"), text!(" [0=off,1=NO,2=NC]")),
            "Emergency stop switch. NO closes when it is pressed. NC opens when it is pressed or when a wire breaks. A pressed switch shuts the machine down: no further step, spindle and coolant off. The motors keep their power until `mt` has passed.";
        MCH "mch": int(0, machines::COUNT as i32 - 1).with(IDLE), 0,
            words(text!("machine"), text!(" [0=careful,1=router,2=mill,3=printer,4=lathe]")),
            "Machine profile that was chosen last. Writing it sets all settings of motors and axes, `ja`, `ct` and `gpl` to the values of that machine: see Machines.";
        KERF "kerf": fixed_text(true), 0,
            bare(text!("Kerf version")),
            "Version of Kerf, which the start-up message has, too. `fb` and `fv` describe the protocol instead.";
    }
}
