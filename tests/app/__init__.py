"""Tests of the window, by what it was to do.

1. Printer in four acts: `test_flows.test_a_printers_owner_…`.
2. Files and summaries of the commands: `test_same_as_commands` (machines, options, whole files).
3. State, command line, project file and back: `tests/jobs`.
4. Two gross errors, left out in the row and in the picture, undone:
   `test_flows.test_a_metrologist_…`.
5. to 9. Processor time, start, first fit, Stop: `python -m benchmarks.bench_app`; bytes,
   requests, answers and memory: `test_figures`; stops, crashes, what is left: `test_process`.
10. Who gets in, and requests at random: `test_guard`, `test_names`, `test_folder`.
11. Two tabs, one fit a change: `test_flows.test_two_tabs_…`, `test_figures.test_one_change_…`,
    `test_guard.test_of_two_tabs_…`; answers in any order: `test_order`.
12. Readers of screens, light and dark, 390 px, keyboard: `test_flows.test_screens_…`,
    `test_flows.test_the_printers_way_…`, `test_the_metrologists_way_…`; where one is:
    `test_staying`.
13. Live, with Kalico and Moonraker: `tests/live/test_moonraker.py` (`make test-kalico`); its
    screen, who starts it and what stops it: `test_measuring`.
14. Without the extra: `test_figures.test_the_package_is_imported_…`.
16. The printer's own probe: `test_flows.test_an_imported_printer_…`; that the firmware takes its
    G-code: `tests/controllers/test_kalico.py`, and of every firmware
    `tests/jobs/test_plan_words.py`.
17. Scripts: `test_scripts`; types are mypy's.
"""
