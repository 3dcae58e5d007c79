"""Calibration of the twin to a real jig: bench records in, a posterior over free numbers out.

`bench` carries out the tests in the twin, `design` runs them over the prior as a campaign,
`emulator` stands in for them, `posterior` compares it with the records.
"""
