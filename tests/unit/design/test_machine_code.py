"""Where the machine code of the searches is kept."""

from __future__ import annotations

from rsmkit.design import machine_code as compiled


def test_machine_code_goes_where_it_can_be_written(tmp_path, monkeypatch):
    find = compiled.cache_folder.__wrapped__
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "chosen"))
    assert find().parent == tmp_path / "chosen"
    blocked = tmp_path / "blocked"
    blocked.write_text("a file, so that nothing can be made inside")
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(blocked))
    assert find().parent == compiled.PACKAGE / "__pycache__"


def test_a_read_only_package_uses_the_cache_of_the_user(tmp_path, monkeypatch):
    package = tmp_path / "package"
    for source in compiled.SOURCES:
        (package / source).parent.mkdir(exist_ok=True)
        (package / source).write_bytes((compiled.PACKAGE / source).read_bytes())
    (package / "__pycache__").write_text("a file, so that nothing can be made inside")
    monkeypatch.setattr(compiled, "PACKAGE", package)
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    before = compiled.cache_folder.__wrapped__()
    assert before.parent == tmp_path / "cache"
    (package / "optimal" / "line_search.py").write_text("changed")
    assert compiled.cache_folder.__wrapped__() != before
