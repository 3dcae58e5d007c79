"""The table of mutants fits the sources and the tests, so that none of them goes stale."""

import ast

import pytest
from mutation import ROOT, Mutant, mutants


def test_there_are_forty_over_all_packages() -> None:
    table = mutants()
    assert len({mutant.wrong for mutant in table}) == len(table) == 40
    packages = {mutant.file.partition("/")[0] for mutant in table}
    assert packages == {"cell", "planning", "experiments"}


@pytest.mark.parametrize("mutant", mutants(), ids=lambda mutant: mutant.wrong)
def test_mutant_is_another_program_and_its_tests_exist(mutant: Mutant) -> None:
    text = (ROOT / mutant.file).read_text()
    assert text.count(mutant.old) == 1
    changed = text.replace(mutant.old, mutant.new)
    assert ast.dump(ast.parse(changed)) != ast.dump(ast.parse(text))
    for name in mutant.tests:
        file, _, test = name.partition("::")
        source = (ROOT / "tests" / f"test_{file}.py").read_text()
        assert f"def {test}(" in source or not test
