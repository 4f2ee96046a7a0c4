"""The studies of the papers this program stands on, each repeated by one command.

`study` is what each offers, and `present` prints it. `ozbek2021` with `ozbek2021_methods`,
`control27` with `control27_loop`, `bicer2017` and `lainiotis` are the studies; `ozbek2021_figure`,
`control27_figure`, `bicer2017_figure` and `lainiotis_figure` are their pages.
"""
