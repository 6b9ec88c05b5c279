/* Generated from derive/tpr2tps.py by `python -m derive`; never edited by hand.
 * derivation 6e6ec8fbc1217320
 * `real` is a number or a lane of numbers, FN(name) the function for that type. */

