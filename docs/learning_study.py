"""Makes the study of docs/learning.md, its table and figures:  python docs/learning_study.py"""

from __future__ import annotations

import re
import shutil
from pathlib import Path
from tempfile import TemporaryDirectory

from pictures import IMAGES, printed

FOLDER = Path(__file__).resolve().parent
PAGE = FOLDER / "learning.md"
GRAPH = "graphs/gallery/adaptive_arm.yaml"
LEARNT = "--initial neurons=runs/adaptive_arm/latest --initial learnt=runs/adaptive_arm/latest"
TRAIN = f"runtime run {GRAPH} --set run.until=40"
DEPLOY = f"""runtime ablate {GRAPH} --seeds 1..8 --set run.until=5 \\
    --set params.strength=0.8 --set params.load=1.5 \\
    --variant 'PD alone' --set params.learning_rate=0 \\
    --variant frozen {LEARNT} \\
        --set params.learning_rate=0 \\
    --variant continued {LEARNT}"""
SECTION = re.compile(r"(<!-- study -->\n).*?(<!-- end of study -->)", re.DOTALL)


def main() -> None:
    with TemporaryDirectory() as name:
        folder = Path(name)
        shutil.copytree(FOLDER.parent / "graphs", folder / "graphs")
        lines = printed(TRAIN, folder).splitlines()
        trained = next(line.split()[1] for line in lines if "rms_error" in line)
        deployed = printed(DEPLOY, folder).split("\n\nablation folder")[0]
        plots = folder / "runs" / "adaptive_arm" / "latest" / "plots"
        shutil.copyfile(plots / "weights.png", IMAGES / "learning_weights.png")
        figure = folder / "ablations" / "adaptive_arm" / "plots" / "ablation.png"
        shutil.copyfile(figure, IMAGES / "learning_deployed.png")
    text = f"""```text
{TRAIN}
{DEPLOY}
```

Over the 40 s of training, the rms error is {trained} rad.

![Weights of the decoder over the 40 s of training](images/learning_weights.png)

```text
{deployed}
```

![Errors of the four variants over eight seeds](images/learning_deployed.png)
"""
    page = PAGE.read_text(encoding="utf-8")
    PAGE.write_text(
        SECTION.sub(lambda found: f"{found[1]}{text}{found[2]}", page), encoding="utf-8"
    )


if __name__ == "__main__":
    main()
