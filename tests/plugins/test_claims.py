"""Claims of publications: plugins offer them, and whoever offers nonsense is left out with a word."""

from types import SimpleNamespace
from typing import Any

import pytest

from posefit import hookimpl
from posefit.claims import ClaimedOrder, claimed_orders, claims_of
from tests.plugins.test_commands import point


def plugin(*orders: Any) -> Any:
    def posefit_register_claims(register: Any) -> None:
        for order in orders:
            register(order)

    return SimpleNamespace(posefit_register_claims=hookimpl(posefit_register_claims))


def test_the_sapso_papers_order_comes_with_its_method() -> None:
    # section 4 of the paper: a particle filter, SAPSO in the full space, SAPSO in the compact one
    assert [one.methods for one in claimed_orders()] == [("particle@full", "sapso@full", "sapso@pca")]


def test_a_plugin_may_claim_several_orders() -> None:
    orders = [ClaimedOrder("a paper", "b beats a", ("a", "b")), ClaimedOrder("another", "a beats b", ("b", "a"))]
    (found,) = claims_of([point("mine", plugin(*orders))], {})
    assert list(found.offers) == orders


@pytest.mark.parametrize("methods", [("a",), (), ("a", "a")])
def test_an_order_is_of_methods_that_differ(methods: tuple[str, ...]) -> None:
    with pytest.raises(ValueError, match="methods must be at least two that differ, got"):
        ClaimedOrder("a paper", "nothing", methods)


def test_what_is_no_order_is_left_out() -> None:
    with pytest.warns(UserWarning, match=r"plugin 'bad' .* a claim must be a ClaimedOrder, got 3"):
        (found,) = claims_of([point("bad", plugin(3))], {})
    assert found.state == "broken"
