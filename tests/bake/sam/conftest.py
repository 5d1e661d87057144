"""These tests bake without the cache, which limits BLAS to one thread; here the limit is set for all of them."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from threadpoolctl import threadpool_limits


@pytest.fixture(autouse=True, scope="package")
def one_blas_thread() -> Iterator[None]:
    with threadpool_limits(1, "blas"):
        yield
