//! The settings of the machine itself.

use super::group;

group! {
    /// The group `sys`.
    system: i32, CAREFUL.system => {
        FB "fb": constant(2), 44_020,
            bare(text!("firmware build")),
            "Build that the protocol is compatible with.";
        FV "fv": constant(3), 970,
            bare(text!("firmware version")).with_decimals(2),
            "Version that the protocol is compatible with.";
        HP "hp": constant(0), 1,
            bare(text!("hardware platform")).with_decimals(2),
            "Kind of hardware.";
        HV "hv": constant(0), 8,
            bare(text!("hardware version")).with_decimals(2),
            "Revision of the hardware.";
        ID "id": fixed_text(false), 0,
            bare(text!("TinyG ID")),
            "Name of the board.";
        JA "ja": fixed(2, 0, POSITIVE).with(UNIT), 10_000_000,
            length(text!("junction acceleration"), NONE),
            "Acceleration towards the centre of a corner; more makes corners faster.";
        CT "ct": fixed(6, 4, 1_000).with(UNIT), 10_000,
            length(text!("chordal tolerance"), NONE),
            "How far the chords of an arc may leave it.";
        SL "sl": int(0, 1), 0,
            bare(text!("soft limit enable")),
            "Moves of homed axes beyond `tn` and `tm` are refused (220).";
        ST "st": int(0, 1), 0,
            words(text!("switch type"), text!(" [0=NO,1=NC]")),
            "Type of all limit and homing switches. The probe is always normally open.";
        MT "mt": up_to(fixed(2, 2, 10), 429_496_700).with(CLAMP), 200,
            words(text!("motor idle timeout"), text!(" Sec")),
            "Seconds after the last move until motors with `pm` 2 lose power.";
        EJ "ej": int(0, 2), 1,
            words(text!("enable json mode"), text!(" [0=text,1=JSON]")),
            "Mode at power-up; afterwards each answer has the mode of the line. With `dia` 1, 2 gives plain text answers.";
        JV "jv": int(0, 5), 3,
            words(text!("json verbosity"), text!(" [0=silent,1=footer,2=messages,3=configs,4=linenum,5=verbose]")),
            "How much JSON responses contain; each level adds to the one below.";
        JS "js": int(0, 1), 1,
            words(text!("json serialize style"), text!(" [0=relaxed,1=strict]")),
            "Whether keys are quoted.";
        TV "tv": int(0, 1), 1,
            words(text!("text verbosity"), text!(" [0=silent,1=verbose]")),
            "Whether lines are answered with a prompt in text mode.";
        QV "qv": int(0, 3), 0,
            words(text!("queue report verbosity"), text!(" [0=off,1=single,2=triple]")),
            "Queue reports: none, free blocks, or also those added and removed (3 is 2).";
        SV "sv": int(0, 2), 1,
            words(text!("status report verbosity"), text!(" [0=off,1=filtered,2=verbose]")),
            "Status reports: none, what has changed, or all of it.";
        SI "si": up_to(fixed(0, 0, 100), 65_535).with(CLAMP), 500,
            words(text!("status interval"), text!(" ms")),
            "Time between status reports.";
        EC "ec": int(0, 1), 0,
            words(text!("expand LF to CRLF on TX"), OFF_ON),
            "Whether lines end in LF CR.";
        EE "ee": int(0, 1), 0,
            words(text!("enable echo"), OFF_ON),
            "Whether each line is sent back before it is answered, as a line of its own.";
        EX "ex": int(0, if ACTIVE.has_handshake() { 2 } else { 1 }), 1,
            words(text!("enable flow control"), text!(" [0=off,1=XON/XOFF,2=RTS/CTS]")),
            "Flow control, in both directions. 2 needs a board with the pins.";
        RXM "rxm": int(0, 1), 1,
            words(text!("serial RX mode"), text!(" [0=char_mode,1=line_mode]")),
            "How the sender paces itself: by lines (4 may be unanswered) or by characters (254).";
        BAUD "baud": up_to(fixed(0, 0, 1), 1_000_000).with(RANGE), 5,
            words(text!("USB baud rate"), text!(" [1=9600,2=19200,3=38400,4=57600,5=115200,6=230400]")),
            "Rate of the USB line: a code, or bits a second from 9600 to 1000000; above 500000 lines may be refused by 13 while motors move. In force when the response has left; 115200 after a reset.";
        NET "net": constant(0), 0,
            words(text!("network mode"), text!(" [0=master]")),
            "Network of boards: there is none.";
        GPL "gpl": int(0, 2), 0,
            words(text!("default gcode plane"), text!(" [0=G17,1=G18,2=G19]")),
            "Plane at power-up and after M2.";
        GUN "gun": int(0, 1), 1,
            words(text!("default gcode units mode"), text!(" [0=G20,1=G21]")),
            "Units at power-up and after M2.";
        GCO "gco": int(1, 9), 1,
            words(text!("default gcode coord system"), text!(" [1-9 (G54-G59.3)]")),
            "Coordinate system at power-up and after M2.";
        GPA "gpa": int(0, 2), 2,
            words(text!("default gcode path control"), text!(" [0=G61,1=G61.1,2=G64]")),
            "Path mode at power-up and after M2.";
        GDI "gdi": int(0, 1), 0,
            words(text!("default gcode distance mode"), text!(" [0=G90,1=G91]")),
            "Distance mode at power-up and after M2.";
        BD "bd": int(0, 1), 1,
            words(text!("block delete"), OFF_ON),
            "Lines that begin with a slash are passed over.";
        OST "ost": int(0, 1), 1,
            words(text!("optional stop"), OFF_ON),
            "M1 stops.";
        PSW "psw": int(0, 1), 1,
            words(text!("program stop waits"), OFF_ON),
            "M0, M1, M6, M60 and G88 wait for `~`, and an exception (38) says so. Senders that see to stops and tools themselves want 0.";
        PBO "pbo": int(0, 1), 1,
            words(text!("probe backs off"), OFF_ON),
            "Whether a probe goes back to the contact. With 0 the machine stays where it came to rest, beyond the contact.";
        DIA "dia": int(0, if cfg!(feature = "dialect-reprap") { 63 } else { 15 }), ACTIVE.dialect as i32,
            words(text!("protocol dialect"), text!(" [0=auto,1=g2core,2=TinyG,3=grbl]")),
            "Whom the sender takes the machine for. With 0 a port speaks TinyG's dialect, or grbl's if the first that is said there in one alone is grbl's. 2 and 3 are one alone, from the next reset on. The second port is as the first, or by itself with 4 more (as 0), 8 more (as 2) or 12 more (as 3): 11 is grbl on the first and TinyG on the second. 16 more is RepRap's on the first, 32 more on the second, in images that have it. As a g2core it ends responses with `[1,status,length]` and has that one's `fb`, `fv`, `hp`, `hv`, prompts, and some status codes and texts.";
        GRM "grm": int(0, 63), 1,
            bare(text!("grbl report mask")),
            "What grbl's reports have: 1 machine position (else work position), 2 free blocks and bytes; 4 inches. Its senders know the first two bits as number 10, the third as 13. 8 holds the machine behind a line of G-code that is refused, until `~` or a reset. 16 has reports tell in a thread how far the axes are ahead of the spindle (`Se`), and 32 has each index pulse tell it, in TinyG's dialect too (`spf`): 4 and 8 of number 10.";
        SPW "spw": int(SHORTEST_PULSE_US, 10).with(IDLE), 2,
            words(text!("step pulse width"), text!(" us")),
            "How long a step pulse lasts. Longer pulses may lower `vm` and `fr`. On boards with an RP2040 0 is half a microsecond.";
        DSU "dsu": int(0, 100).with(IDLE), 1,
            words(text!("direction setup time"), text!(" us")),
            "How long a direction pin stands before a step.";
        SAF "saf": int(0, 2), 0,
            words(text!("safety door"), text!(" [0=off,1=NO,2=NC]")),
            "Door switch: none, one that closes when the door is opened, or one that opens. An open door holds the machine; `~` resumes when it is shut.";
        EST "est": int(0, 2), 0,
            words(text!("emergency stop"), text!(" [0=off,1=NO,2=NC]")),
            "Emergency stop: none, one that closes when it is hit, or one that opens, as a broken wire does. It shuts the machine down: no step more, spindle and coolant off, motors keep their power until `mt` is over.";
        MCH "mch": int(0, machines::COUNT as i32 - 1).with(IDLE), 0,
            words(text!("machine"), text!(" [0=careful,1=router,2=mill,3=printer,4=lathe]")),
            "MachineProfile that was chosen last. Choosing one sets all settings of motors and axes, `ja`, `ct` and `gpl` to what they are on that machine: see Machines.";
        KERF "kerf": fixed_text(true), 0,
            bare(text!("Kerf version")),
            "Version of Kerf, which the greeting tells, too. `fb` and `fv` are the protocol's.";
    }
}
