//! Data that senders keep with the machine.

use super::group;

group! {
    /// The groups `uda` to `udd`.
    user: i32, PLAIN => {
        D0 "0": bits(Kind::Data), 0,
            bare(USER_DATA),
            "First value of the group.";
        D1 "1": bits(Kind::Data), 0,
            bare(USER_DATA),
            "Second value of the group.";
        D2 "2": bits(Kind::Data), 0,
            bare(USER_DATA),
            "Third value of the group.";
        D3 "3": bits(Kind::Data), 0,
            bare(USER_DATA),
            "Fourth value of the group.";
    }
}

group! {
    /// The group `jid`.
    job: i32, PLAIN => {
        A "a": bits(Kind::Job), 0,
            bare(JOB_ID),
            "First value of the job ID.";
        B "b": bits(Kind::Job), 0,
            bare(JOB_ID),
            "Second value of the job ID.";
        C "c": bits(Kind::Job), 0,
            bare(JOB_ID),
            "Third value of the job ID.";
        D "d": bits(Kind::Job), 0,
            bare(JOB_ID),
            "Fourth value of the job ID.";
    }
}
