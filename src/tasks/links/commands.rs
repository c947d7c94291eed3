//! From whoever reads lines to the planner: the commands of one line at a time, filled in place.
//!
//! The parser, a row of lines, the SD card and what a line asks of the machine fill the slot while it is free
//! ([`CommandSender`]). The planner has it from [`send`](CommandSender::send) until [`done`](CommandReceiver::done), and
//! then wakes the parser. When the slot is full, senders answer that the line has to wait; nothing is queued here.
//!
//! `embassy_sync::zerocopy_channel` has the same shape. Its state takes some 20 bytes of RAM where this takes 8, and
//! its `push_done` can panic.

use core::cell::{Ref, RefMut};

use kerf_macros::small;

use super::Links;
use crate::gcode::command::{Commands, Stop};

/// The end of those who fill the slot.
#[derive(Clone, Copy)]
#[repr(transparent)]
pub struct CommandSender<'a>(&'a Links);

/// The planner's end.
#[derive(Clone, Copy)]
#[repr(transparent)]
pub struct CommandReceiver<'a>(&'a Links);

impl Links {
    /// Returns the end of those who give the planner commands.
    #[inline(always)]
    pub const fn command_sender(&self) -> CommandSender<'_> {
        CommandSender(self)
    }

    /// Returns the planner's end.
    #[inline(always)]
    pub const fn command_receiver(&self) -> CommandReceiver<'_> {
        CommandReceiver(self)
    }

    /// Makes the planner look again at what it waits for, although no commands have come.
    #[inline(always)]
    pub fn wake_planner(&self) {
        self.planner_wake.signal();
    }
}

impl<'a> CommandSender<'a> {
    /// Whether the slot may be filled.
    #[inline(always)]
    pub fn is_free(self) -> bool {
        !self.0.commands_taken.get()
    }

    /// Returns the slot. It has the commands that were sent last.
    #[inline(always)]
    pub fn slot(self) -> RefMut<'a, Commands> {
        self.0.commands.borrow_mut()
    }

    /// Whether the commands that were sent last end the program.
    #[inline(always)]
    pub fn ends_program(self) -> bool {
        self.0.commands.borrow().stop == Stop::End
    }

    /// Hands the slot to the planner. It must be free, and filled.
    #[inline(never)]
    #[small]
    pub fn send(self) {
        self.0.commands_taken.set(true);
        self.0.planner_wake.signal();
    }
}

impl<'a> CommandReceiver<'a> {
    /// Waits until the planner has been woken, by commands or otherwise.
    #[inline(always)]
    pub fn woken(self) -> impl Future<Output = ()> + use<'a> {
        self.0.planner_wake.wait()
    }

    /// Whether commands have been sent.
    #[inline(always)]
    pub fn has_commands(self) -> bool {
        self.0.commands_taken.get()
    }

    /// Returns the commands that have been sent.
    #[inline(always)]
    pub fn commands(self) -> Ref<'a, Commands> {
        self.0.commands.borrow()
    }

    /// Frees the slot.
    #[inline(always)]
    pub fn done(self) {
        self.0.commands_taken.set(false);
    }
}
