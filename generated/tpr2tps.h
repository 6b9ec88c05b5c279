/* Generated from derive/tpr2tps.py by `python -m derive`; never edited by hand.
 * derivation f7bec5cf90a4843b
 * `real` is a number or a lane of numbers, FN(name) the function for that type. */

