"""Provoke every fault of docs/reliability.md for real and print its table, with what happened this time.

Run with ``python benchmarks/runs_reliability.py [KILLS [MUTATIONS]]``: 200 kills at random moments and 10,000
mutations of each kind of file unless told otherwise (about half an hour; ``6 150`` takes a few minutes). Exit
code 1 if any outcome is not the documented one.
"""

import os
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path
from tempfile import TemporaryDirectory

ROOT = Path(__file__).parents[1]

EVALUATE = "tests/unit/runs/test_evaluation.py::"
WORKER = "tests/unit/runs/test_worker.py::"
OUTCOMES = WORKER + "test_outcomes_inside_one_worker"
GUILTY = EVALUATE + "test_only_the_guilty_run_is_blamed_when_a_process_dies"
JOURNAL = "tests/unit/runs/test_journal.py::"
PROPERTY = "tests/property/runs/test_journal.py::"
DRIVER = "tests/e2e/runs/test_interruption.py::"
HOSTILE = "tests/property/study/test_hostile_files.py::"
LEFT = EVALUATE + "test_what_a_run_leaves_behind_does_not_harm_the_others"
COMMAND = "tests/unit/runs/test_command.py::"
DASK = "tests/e2e/runs/test_dask.py::"

# fault, what happens, what is lost, the test that provokes it
FAULTS = (
    (
        "the simulator raises",
        "`failed`, traceback kept; the others are made",
        "that run",
        EVALUATE + "test_a_failing_run_is_recorded_and_the_others_are_finished",
    ),
    ("calls `sys.exit`", "`failed`", "that run", f"{OUTCOMES}[exit"),
    ("recurses without end", "`failed` (RecursionError)", "that run", f"{OUTCOMES}[recursion"),
    ("asks for too much memory", "`failed` (MemoryError)", "that run", f"{OUTCOMES}[memory"),
    (
        "is killed by the kernel or a person (`SIGKILL`)",
        "repeated alone, `crashed` the third time",
        "that run",
        f"{GUILTY}[killed",
    ),
    (
        "segmentation fault",
        "`crashed`, Python stack kept; runs under way in other workers are repeated",
        "that run",
        f"{GUILTY}[segfault",
    ),
    ("calls `os._exit`", "`crashed` with the exit code", "that run", f"{GUILTY}[os_exit"),
    (
        "hangs in Python",
        "`timeout` at `timeout_s`, traceback of where it hung",
        "that run",
        WORKER + "test_a_slow_run_is_stopped_at_its_time_limit",
    ),
    (
        "hangs in compiled code",
        "its process is ended 2 s after `timeout_s`, `timeout`",
        "that run",
        f"{GUILTY}[hang_on",
    ),
    ("returns nan or infinity", "`failed`, names the response", "that run", f"{OUTCOMES}[nan"),
    (
        "leaves a response out",
        "`failed`, names it; the other numbers are kept",
        "that run",
        f"{OUTCOMES}[missing",
    ),
    (
        "returns text, complex numbers, nothing",
        "`failed`, says what it returned",
        "that run",
        f"{OUTCOMES}[text",
    ),
    (
        "returns something that cannot be sent between processes",
        "`failed`",
        "that run",
        WORKER + "test_a_value_that_cannot_be_sent_back_fails_its_run_only",
    ),
    (
        "waits for typing",
        "`failed` at once (EOFError)",
        "that run",
        WORKER + "test_a_simulator_that_waits_for_typing_fails_at_once",
    ),
    (
        "never lets go of memory",
        "its worker is replaced between runs",
        "nothing",
        EVALUATE + "test_a_worker_whose_memory_keeps_growing_is_replaced",
    ),
    (
        "closes or replaces the streams, changes the working folder",
        "the next run begins clean",
        "nothing",
        WORKER + "test_a_run_begins_where_the_worker_began",
    ),
    (
        "puts something else in the place of the streams",
        "the next run begins clean",
        "nothing",
        WORKER + "test_streams_that_a_run_broke_are_whole_in_the_next",
    ),
    (
        "returns truth values, lists, mappings, odd keys or objects that cannot be written",
        "`failed` where a response is no number, else kept as far as it can be",
        "that run",
        f"{OUTCOMES}[inner_dict",
    ),
    (
        "raises `BaseException`, `KeyboardInterrupt` or an exception that cannot be pickled",
        "`failed`",
        "that run",
        f"{OUTCOMES}[odd_error",
    ),
    (
        "signals itself (Ctrl-C, `SIGTERM`, `SIGHUP`)",
        "nothing: workers leave these to the driver",
        "nothing",
        f"{OUTCOMES}[signals_itself",
    ),
    (
        "takes Ctrl-C, `SIGTERM`, `SIGHUP` for itself",
        "they are the driver's again in the next run; the terminal reaches no worker",
        "nothing",
        EVALUATE + "test_signals_that_a_run_took_are_the_drivers_again_in_the_next",
    ),
    (
        "prints and returns megabytes",
        "the end of what it prints is kept, and no extra of over 10,000 values or characters",
        "nothing",
        f"{OUTCOMES}[floods",
    ),
    (
        "leaves children, daemons, copies of itself running",
        "they go on; the runs are made",
        "nothing",
        f"{LEFT}[leaves_children",
    ),
    (
        "uses processes of its own (multiprocessing, joblib)",
        "the runs are made",
        "nothing",
        WORKER + "test_a_run_may_use_processes_of_its_own",
    ),
    (
        "forks, and the copy comes back from its run",
        "the copy is ended",
        "nothing",
        WORKER + "test_a_copy_of_the_worker_that_comes_back_is_ended",
    ),
    (
        "replaces functions of Python, empties the module search path",
        "the next runs are made",
        "nothing",
        f"{LEFT}[patches",
    ),
    (
        "leaves a thread, or something to do at exit, that never ends",
        "its worker is ended 5 s after the last run",
        "nothing",
        f"{LEFT}[never_ends",
    ),
    (
        "catches every exception, the time limit included",
        "its process is ended 2 s after `timeout_s`, `timeout`",
        "that run",
        f"{LEFT}[swallow",
    ),
    (
        "its process is stopped (`SIGSTOP`)",
        "ended 12 s after `timeout_s`, `timeout`",
        "that run",
        f"{LEFT}[stopped",
    ),
    (
        "cannot be imported",
        "one message, exit code 2, nothing recorded",
        "nothing",
        EVALUATE + "test_a_simulator_that_cannot_be_loaded_stops_the_evaluation_with_one_message",
    ),
    (
        "takes more than two minutes to import",
        "one message, exit code 2",
        "nothing",
        EVALUATE + "test_a_module_that_cannot_be_used_is_one_message",
    ),
    (
        "needs longer to warm up than a run may take",
        "no run's clock is running; the runs are made",
        "nothing",
        EVALUATE + "test_warming_up_is_done_once_in_each_worker_and_costs_no_run_its_time",
    ),
    (
        "still warms up in one worker when another dies",
        "only the run that died is blamed",
        "nothing",
        EVALUATE + "test_a_worker_that_warms_up_is_not_blamed_when_another_dies",
    ),
    (
        "cannot be warmed up",
        "one message, exit code 2, nothing recorded",
        "nothing",
        EVALUATE + "test_a_simulator_that_cannot_be_warmed_up_stops_the_evaluation_with_one_message",
    ),
    (
        "takes more than ten minutes to warm up",
        "one message, exit code 2",
        "nothing",
        EVALUATE + "test_warming_up_has_an_end",
    ),
    (
        "its machine code is compiled while several workers start",
        "one compiles, the others wait for it; if it is killed, the next one compiles",
        "nothing",
        "tests/unit/test_machine_code.py::test_a_compiling_process_that_is_killed_holds_nobody_up",
    ),
    (
        "one point of a vectorised batch is bad",
        "the batch is repeated point by point, only that one `failed`",
        "that run",
        EVALUATE + "test_in_a_vectorised_batch_only_the_guilty_fail",
    ),
    (
        "external program fails",
        "`failed` with exit code and the last line of its stderr; by a signal: `crashed`",
        "that run",
        COMMAND + "test_what_can_go_wrong_is_said[words0",
    ),
    (
        "external program hangs",
        "it and all its children are ended, `timeout`",
        "that run",
        COMMAND + "test_a_time_limit_ends_the_whole_family[family",
    ),
    (
        "external program is deaf to `SIGTERM`, its child a daemon",
        "both are killed a second later, `timeout`",
        "that run",
        COMMAND + "test_a_time_limit_ends_the_whole_family[stubborn",
    ),
    (
        "external program writes bytes that are no text, decimal commas",
        "what can be read is read; `2,5` is no number, `failed`",
        "that run",
        COMMAND + "test_bytes_that_are_no_text_do_no_harm",
    ),
    (
        "external program leaves a file of gigabytes to read",
        "`failed`: results are read from at most 256 MB",
        "that run",
        COMMAND + "test_a_file_too_large_to_read_is_refused",
    ),
    (
        "external program leaves a pipe or a device to read",
        "`failed`",
        "that run",
        COMMAND + "test_what_can_go_wrong_is_said[words3",
    ),
    (
        "a pattern for outputs takes for ever",
        "`failed` after 60 s",
        "that run",
        COMMAND + "test_a_pattern_that_takes_for_ever_is_stopped",
    ),
    (
        "a worker is killed",
        "what it and its neighbours were running is repeated; nobody is blamed",
        "nothing",
        DRIVER + "test_killing_a_worker_only_repeats_what_it_took_along",
    ),
    (
        "a worker is killed while it runs an external program",
        "the program is ended too, then run again",
        "nothing",
        DRIVER + "test_killing_a_worker_ends_its_external_program_before_it_is_run_again",
    ),
    (
        "Ctrl-C once",
        "running runs are finished and recorded, exit code 130",
        "nothing",
        DRIVER + "test_interrupting_once_finishes_what_is_running",
    ),
    (
        "Ctrl-C twice",
        "stops at once, exit code 130; external programs end too",
        "runs under way",
        DRIVER + "test_interrupting_twice",
    ),
    (
        "`SIGTERM`; the terminal is closed (`SIGHUP`)",
        "like Ctrl-C",
        "nothing",
        DRIVER + "test_a_request_to_terminate_is_like_an_interrupt",
    ),
    (
        "the driver is stopped for a while (`SIGSTOP`, Ctrl-Z)",
        "runs under way are finished meanwhile; nobody is blamed",
        "nothing",
        DRIVER + "test_a_driver_that_was_stopped_for_a_while",
    ),
    (
        "nobody reads the output any more (`rsmkit evaluate 2>&1 \\| head`)",
        "stops without a word, exit code 1; the same command goes on",
        "runs under way",
        DRIVER + "test_output_that_nobody_reads_any_more",
    ),
    (
        "the driver is killed (`SIGKILL`)",
        "workers and external programs end within seconds; the same command goes on",
        "runs under way",
        DRIVER + "test_killing_the_driver",
    ),
    (
        "drivers and workers are killed at 200 random moments",
        "every study is completed, each run recorded once",
        "runs under way",
        "tests/e2e/runs/test_kill.py::test_kills_at_random_moments",
    ),
    (
        "two drivers on one study",
        "the second is refused, told process, computer and time of the first; exit code 2",
        "nothing",
        DRIVER + "test_a_second_driver_is_refused",
    ),
    (
        "a person removes the lock file of a driver at work",
        "the second driver is refused all the same",
        "nothing",
        JOURNAL + "test_a_second_driver_is_refused_even_when_the_lock_file_was_removed",
    ),
    (
        "a killed driver's lock is left",
        "taken over: the kernel has released it",
        "nothing",
        JOURNAL + "test_the_lock_of_a_killed_driver_does_not_count",
    ),
    (
        "the disk is full",
        "stops with one message, exit code 2; whole lines are kept, a torn one is cut off",
        "what did not fit",
        DRIVER + "test_a_disk_that_fills_up_keeps_every_whole_line",
    ),
    (
        "the disk fails to flush what was written (`EIO`)",
        "stops with one message, exit code 2",
        "what was not flushed",
        JOURNAL + "test_a_disk_that_fails_to_flush_is_one_message",
    ),
    (
        "the folder is read-only",
        "one message, exit code 2, before any run",
        "nothing",
        DRIVER + "test_a_read_only_folder_is_one_clear_message",
    ),
    (
        "the journal is cut at any byte",
        "the cut line is ignored, and removed before the next append",
        "that line",
        PROPERTY + "test_a_journal_cut_at_any_byte",
    ),
    (
        "zeros at the journal's end after a power cut",
        "likewise",
        "nothing",
        JOURNAL + "test_a_file_of_zeros_after_a_power_cut_is_healed",
    ),
    (
        "the journal is damaged in the middle",
        "refused, with the line's number and what to do",
        "nothing",
        JOURNAL + "test_a_damaged_line_in_the_middle_is_named",
    ),
    (
        "the journal or its folder is deleted while runs are made",
        "stops with one message at the next run that ends",
        "the journal",
        JOURNAL + "test_a_journal_deleted_under_our_hands_is_noticed",
    ),
    (
        "the study's folder is renamed while runs are made",
        "goes on, unless the study was given by its full path: then it stops with one message",
        "nothing",
        EVALUATE + "test_a_folder_that_is_renamed_under_way_does_no_harm",
    ),
    (
        "the journal has CRLF line ends, a byte-order mark",
        "loads",
        "nothing",
        JOURNAL + "test_line_ends_and_marks_of_other_systems_are_understood",
    ),
    (
        "a folder stands in the place of the journal",
        "one message, exit code 2",
        "nothing",
        JOURNAL + "test_a_folder_in_the_place_of_the_journal_is_one_message",
    ),
    (
        "a pipe or a device stands in the place of the journal",
        "one message, exit code 2",
        "nothing",
        JOURNAL + "test_a_pipe_or_a_device_in_the_place_of_the_journal_is_one_message",
    ),
    (
        "the journal is hostile (10,000 mutations)",
        "loads what is sound or refuses, never more",
        "nothing",
        PROPERTY + "test_no_mutation_of_a_journal_gets_past",
    ),
    (
        "the study file is hostile (10,000 mutations)",
        "one message that names the key; nothing is evaluated, nothing is written",
        "nothing",
        HOSTILE + "test_no_mutated_study_file_gets_past",
    ),
    (
        "design, plan, model, optimum or verification are hostile (10,000 each)",
        "one message that names the file and the command that makes it anew",
        "that stage",
        HOSTILE + "test_no_mutated_artefact_gets_past",
    ),
    (
        "a table of the user's own points is hostile",
        "one message that names file, line and column",
        "nothing",
        HOSTILE + "test_no_mutated_table_of_points_gets_past",
    ),
    (
        "the journal is of an older format",
        "loads",
        "nothing",
        JOURNAL + "test_journals_of_every_format_so_far_still_load",
    ),
    (
        "the clock jumps",
        "durations come from a clock that cannot; nothing is decided by the calendar",
        "nothing",
        EVALUATE + "test_a_clock_that_jumps_changes_nothing",
    ),
    (
        "a dask worker is killed",
        "its runs are repeated on others",
        "nothing",
        DASK + "test_a_killed_dask_worker_costs_no_run",
    ),
    (
        "a run kills every dask worker it meets",
        "`crashed`; the others are made",
        "that run",
        DASK + "test_only_the_run_that_kills_dask_workers_is_blamed",
    ),
    (
        "a run hangs on dask",
        "`timeout` at `timeout_s`; in compiled code its worker is replaced 17 s later",
        "that run",
        DASK + "test_a_run_that_hangs_on_dask_is_ended",
    ),
    (
        "the dask scheduler is killed",
        "stops with one message, exit code 2; the same command goes on with a new scheduler",
        "runs under way",
        DASK + "test_the_loss_of_a_dask_cluster_is_one_message[scheduler-9",
    ),
    (
        "the dask scheduler is silent, or all workers are gone",
        "stops with one message after a minute, exit code 2",
        "runs under way",
        DASK + "test_the_loss_of_a_dask_cluster_is_one_message",
    ),
)


def table():
    """The table of docs/reliability.md."""
    rows = ["| what goes wrong | what happens | what is lost |", "|---|---|---|"]
    return "\n".join([*rows, *(f"| {fault} | {outcome} | {lost} |" for fault, outcome, lost, _ in FAULTS)])


def main(kills="200", mutations="10000"):
    files = sorted({test.partition("::")[0] for *_, test in FAULTS})
    with TemporaryDirectory() as folder:
        report = Path(folder) / "report.xml"
        subprocess.run(
            [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", f"--junitxml={report}", *files],
            cwd=ROOT,
            env={**os.environ, "RSMKIT_KILLS": kills, "RSMKIT_MUTATIONS": mutations},
            check=False,
        )
        cases = ElementTree.parse(report).getroot().iter("testcase")
        verdicts = {f"{case.get('classname')}::{case.get('name')}": len(case) == 0 for case in cases}
    bad = 0
    print("\n| what goes wrong | as documented |\n|---|---|")
    for fault, _, _, test in FAULTS:
        wanted = test.replace("/", ".").replace(".py::", "::")
        found = [good for name, good in verdicts.items() if name.startswith(wanted)]
        good = bool(found) and all(found)
        bad += not good
        print(f"| {fault} | {'yes' if good else 'NO'} |")
    print(f"\n{len(FAULTS) - bad} of {len(FAULTS)} faults end as documented")
    return min(bad, 1)


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
