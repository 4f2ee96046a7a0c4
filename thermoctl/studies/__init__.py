"""Offline work without a clock: replays, and experiments reproduced.

- Records: `record` is what a file holds, read by `csv_record` or `history_record`; `scaled` has it
  in the variables of a law.
- `replay` runs the estimators of `laws` over a record, `whiteness` tests their innovations, and
  `orders` weighs order and delay. `wide` is a model wide enough for every order.
- Commissioning: `excitation` is the test signal, `tuning` what a run through it teaches,
  `plant_words` the plant in physical units and `tuning_limits` limits that suit it.
- `experiment` measures a control run; `compare` and `papers` are rooms of their own.
- Output: `present` and `tables` for people, `words` for single figures, `figure` for the style of
  pictures; `orders_figure`, `orders_words`, `replay_figure`, `tuning_figure`, `tuning_words` and
  `experiment_figure` for one study each.
"""
