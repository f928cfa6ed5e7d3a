"""An external program for the tests: ``program.py WHAT [ARGUMENT...]``."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

what, *arguments = sys.argv[1:]
print("a line of chatter")
match what:
    case "json":
        print(json.dumps({"y": sum(map(float, arguments)), "words": arguments}))
    case "files":
        data = json.loads(Path("in.json").read_text())
        Path("sub").mkdir(exist_ok=True)
        Path("sub/out.json").write_text(json.dumps({"y": data["a"] * 2, "list": [{"z": data["b"]}]}))
        Path("table.csv").write_text("t, v\n0, 1.5D0\n1, 2.5\n\n")
        print("step 1: drag = 1e3\nstep 2: drag = -2.5E-1 N")
    case "environment":
        names = ("OMP_NUM_THREADS", "MINE", "PATH")
        print(json.dumps({"y": 1.0, "cwd": os.getcwd(), **{name: os.environ.get(name) for name in names}}))
    case "fail":
        print("first", file=sys.stderr)
        print("mesh is tangled\n", file=sys.stderr)
        sys.exit(3)
    case "die":
        os.abort()
    case "realtime":
        os.kill(os.getpid(), signal.SIGRTMIN + 3)
    case "pipes":
        for name in ("stdout.txt", "stderr.txt"):
            os.unlink(name)
            os.mkfifo(name)
        sys.exit(*map(int, arguments))
    case "mark":
        Path("out.json").write_bytes(b'\xef\xbb\xbf{"y": 7}\r\n')
    case "family":
        # a child of its own, which must not outlive it
        child = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(3600)"])
        Path("pids").write_text(f"{os.getpid()} {child.pid}")
        if arguments:
            Path(arguments[0]).write_text(f"{os.getpid()} {child.pid}")
        time.sleep(3600)
    case "stubborn":
        # deaf to SIGTERM, with a daemon that has left the process group
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        child = subprocess.Popen(
            [sys.executable, "-c", "import time; time.sleep(3600)"], start_new_session=True
        )
        Path("pids").write_text(f"{os.getpid()} {child.pid}")
        time.sleep(3600)
    case "bytes":
        sys.stdout.buffer.write(b"drag \xe9\xff = 2,5\ndrag = 0x1\n\xb0C = 7\n")
    case "flood":
        Path("big.txt").write_bytes(b"")
        os.truncate("big.txt", 1 << 40)
    case "say":
        print(*arguments)
    case "nothing":
        sys.stdout.flush()
        Path("stdout.txt").write_text("")
