//! The board: an MPS2 with AN386, a Cortex-M4F at 25 MHz, as QEMU emulates it.

use core::panic::PanicInfo;

use cortex_m::{
    Peripherals,
    peripheral::{SYST, syst::SystClkSource},
};
use cortex_m_rt::entry;
use cortex_m_semihosting::{
    debug::{self, ExitStatus},
    heprintln, hio,
};
use foxhunt_embedded::{Cost, Failure, run_ekf, run_ukf};

/// The timer counts 24 bits down.
const FULL: u32 = 0x00ff_ffff;
const TICK_NS: u32 = 40;
/// As the emulator is run: `-icount shift=6`.
const INSTRUCTION_NS: u32 = 64;

#[entry]
fn main() -> ! {
    match report() {
        Ok(()) => exit(debug::EXIT_SUCCESS),
        Err(failure) => {
            heprintln!("{failure}");
            exit(debug::EXIT_FAILURE)
        }
    }
}

/// Ends the emulator.
fn exit(status: ExitStatus) -> ! {
    debug::exit(status);
    loop {
        cortex_m::asm::wfi();
    }
}

/// Without the message: to print it would take 10 KiB of flash.
#[panic_handler]
fn panic(_: &PanicInfo<'_>) -> ! {
    exit(debug::EXIT_FAILURE)
}

/// Results to the standard output of the emulator, what they cost to its standard error.
fn report() -> Result<(), Failure> {
    let mut timer = Peripherals::take().expect("taken nowhere else").SYST;
    timer.set_clock_source(SystClkSource::Core);
    timer.set_reload(FULL);
    timer.clear_current();
    timer.enable_counter();

    let mut out = hio::hstdout().map_err(|()| Failure::Output)?;
    print_cost("ekf", run_ekf(&mut out, stopwatch())?);
    print_cost("ukf", run_ukf(&mut out, stopwatch())?);
    let untouched = cortex_m_stack::stack_painted();
    heprintln!("stack: {} bytes", cortex_m_stack::stack_size() - untouched);
    Ok(())
}

/// Counts the instructions since it was called before: the emulator is run with 64 ns for each.
fn stopwatch() -> impl FnMut() -> u32 {
    let mut last = 0_u32;
    move || {
        let now = SYST::get_current();
        let ticks = last.wrapping_sub(now) & FULL;
        last = now;
        ticks * TICK_NS / INSTRUCTION_NS
    }
}

fn print_cost(filter: &str, cost: Cost) {
    let Cost { steps, total, most } = cost;
    heprintln!("{filter}: {} instructions a step, at most {most}, {steps} steps", total / steps);
}
