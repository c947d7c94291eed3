//! The deepest stack, by analysis of the call graph.
//!
//! Thread mode runs from `main`. On top of it, each interrupt handler that enables interrupts again (the exec
//! executor's) counts once, plus the deepest handler that does not.
//!
//! Which functions an indirect call reaches is an assumption. Outside tasks (in an executor's poll) it reaches the
//! deepest task of that level, or any other function whose address is taken. Inside a task it reaches the deepest
//! function whose address is taken. These functions are assumed to make no further indirect calls.

use std::collections::HashMap;

use anyhow::{Context, Result};

use super::Image;
use super::disasm::Code;
use super::flow::{self, Flow, Landmarks, RETURN_ADDRESS};
use super::places::{address, addresses_taken, handlers, landmarks, name_at, task_name};

/// One function on a chain of calls, and what it has on the stack there, including its return address.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Link {
    /// The function.
    pub name: String,
    /// Bytes on the stack.
    pub bytes: u32,
}

/// The deepest chain of calls from a root.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Chain {
    /// The functions, from the root on.
    pub links: Vec<Link>,
    /// Whether any function that the root reaches enables interrupts.
    enables_interrupts: bool,
}

impl Chain {
    /// Bytes of all functions together.
    pub fn bytes(&self) -> u32 {
        self.links.iter().map(|link| link.bytes).sum()
    }

    /// The root's name.
    pub fn root(&self) -> &str {
        self.links.first().map_or("", |link| &link.name)
    }
}

/// The result of the analysis.
#[derive(Debug, Default)]
pub struct Stack {
    /// The deepest chain of thread mode.
    pub main: Chain,
    /// The chains of handlers that let others interrupt them.
    pub nesting: Vec<Chain>,
    /// The deepest handler that does not let others interrupt it.
    pub short: Chain,
    /// Functions without a bound: recursion, or a loop that pushes.
    pub unbounded: Vec<String>,
}

impl Stack {
    /// Analyses an image; `interrupt_tasks` names the tasks that do not run in thread mode.
    pub fn of(image: &Image, interrupt_tasks: &[&str]) -> Result<Stack> {
        Graph::new(image, Code::load(&image.path)?, interrupt_tasks).analyse()
    }

    /// Bytes if everything is at its deepest at once.
    pub fn bytes(&self) -> u32 {
        let nesting: u32 = self.nesting.iter().map(Chain::bytes).sum();
        self.main.bytes() + nesting + self.short.bytes()
    }
}

/// Where a function runs, which decides which functions its indirect calls reach.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
struct Place {
    interrupt: bool,
    inside: Inside,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Inside {
    Executor,
    Task,
    Callback,
}

struct Graph<'a> {
    image: &'a Image,
    code: Code,
    marks: Landmarks,
    thread_tasks: Vec<u32>,
    interrupt_tasks: Vec<u32>,
    callbacks: Vec<u32>,
    /// `None` while a chain is being computed. Meeting that again means recursion.
    chains: HashMap<(u32, Place), Option<Chain>>,
    unbounded: Vec<String>,
}

impl<'a> Graph<'a> {
    fn new(image: &'a Image, code: Code, interrupt_names: &[&str]) -> Graph<'a> {
        let taken = addresses_taken(image, &code);
        let task = |address: &u32| task_name(&name_at(image, *address));
        let (tasks, callbacks): (Vec<u32>, _) = taken.into_iter().partition(|a| task(a).is_some());
        let is_interrupt = |address: &u32| {
            task(address).is_some_and(|name| interrupt_names.contains(&name.as_str()))
        };
        let (mut interrupt_tasks, thread_tasks): (Vec<u32>, Vec<u32>) =
            tasks.iter().copied().partition(is_interrupt);
        if interrupt_tasks.is_empty() {
            interrupt_tasks = tasks;
        }
        let (marks, chains, unbounded) = (landmarks(image), HashMap::new(), Vec::new());
        Graph { image, code, marks, thread_tasks, interrupt_tasks, callbacks, chains, unbounded }
    }

    fn analyse(mut self) -> Result<Stack> {
        let main = self.image.named(|name| name == "main").next();
        let main = address(main.context("the image has no `main`")?.address);
        let main = self.root(main, false);
        let handlers = handlers(self.image).into_iter().map(|entry| self.root(entry, true));
        let handlers: Vec<_> = handlers.collect();
        let (nesting, short): (Vec<_>, Vec<_>) =
            handlers.into_iter().partition(|chain| chain.enables_interrupts);
        let short = short.into_iter().max_by_key(Chain::bytes).unwrap_or_default();
        self.unbounded.sort();
        self.unbounded.dedup();
        Ok(Stack { main, nesting, short, unbounded: self.unbounded })
    }

    fn root(&mut self, entry: u32, interrupt: bool) -> Chain {
        let mut chain = self.chain(entry, Place { interrupt, inside: Inside::Executor });
        // Adds the return address that the start-up code or the hardware has pushed.
        if let Some(first) = chain.links.first_mut() {
            first.bytes += RETURN_ADDRESS;
        }
        chain
    }

    /// Returns the deepest chain of calls from a function, without its own return address.
    fn chain(&mut self, entry: u32, place: Place) -> Chain {
        match self.chains.get(&(entry, place)) {
            Some(Some(known)) => return known.clone(),
            Some(None) => {
                self.unbounded.push(format!("recursion through {}", name_at(self.image, entry)));
                return Chain::default();
            }
            None => self.chains.insert((entry, place), None),
        };
        let flow = flow::follow(&self.code, entry, &self.marks);
        let name = name_at(self.image, entry);
        if flow.bottomless {
            self.unbounded.push(format!("a loop that pushes in {name}"));
        }
        let chain = self.deepest(&flow, &name, place);
        self.chains.insert((entry, place), Some(chain.clone()));
        chain
    }

    fn deepest(&mut self, flow: &Flow, name: &str, place: Place) -> Chain {
        let own = Link { name: name.to_owned(), bytes: flow.frame };
        let mut best = Chain { links: vec![own], enables_interrupts: flow.enables_interrupts };
        for (callee, depth, place) in self.callees(flow, place) {
            let below = self.chain(callee, place);
            let enables = best.enables_interrupts | below.enables_interrupts;
            if depth + below.bytes() > best.bytes() {
                let own = Link { name: name.to_owned(), bytes: depth };
                best.links = std::iter::once(own).chain(below.links).collect();
            }
            best.enables_interrupts = enables;
        }
        best
    }

    /// Returns all functions that a function may call, with the depth of each call.
    fn callees(&self, flow: &Flow, place: Place) -> Vec<(u32, u32, Place)> {
        let mut all: Vec<_> =
            flow.calls.iter().map(|(callee, depth)| (*callee, *depth, place)).collect();
        let Some(depth) = flow.indirect else { return all };
        if place.inside == Inside::Executor {
            let inside = Place { inside: Inside::Task, ..place };
            let tasks = if place.interrupt { &self.interrupt_tasks } else { &self.thread_tasks };
            all.extend(tasks.iter().map(|task| (*task, depth, inside)));
        }
        if place.inside != Inside::Callback {
            let inside = Place { inside: Inside::Callback, ..place };
            all.extend(self.callbacks.iter().map(|callback| (*callback, depth, inside)));
        }
        all
    }
}

#[cfg(test)]
mod tests;
