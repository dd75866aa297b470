"""An independent simulator of hands, for evaluating checks and solvers that were developed with the other
one.

It is based only on published anatomy and on the descriptions of layouts, and shares nothing but the format of
poses with the project's simulator.
"""
