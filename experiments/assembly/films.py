"""What is asked for besides results: a recording and a video of a run."""

from __future__ import annotations

from experiments.assembly.film import Film
from experiments.assembly.job import Job
from experiments.assembly.pictures import Pictures
from experiments.assembly.recording import write_recording
from experiments.assembly.run import Run
from experiments.assembly.video import PACE, write_video


def write_films(job: Job, run: Run, film: Film, pictures: Pictures) -> None:
    """Write the recording and the video that a job asks for; the video joins the pictures.

    Where nothing can be rendered there is no video; the report says why.
    """
    cell, log = run.simulation.cell, run.simulation.log.arrays()
    if job.record is not None:
        about = {"product": job.product.name, "seed": str(job.seed), "verdict": run.verdict}
        write_recording(job.record, cell, log, film, about)
    if job.video is not None and pictures.problem is None and "time" in log:
        write_video(job.video, cell, log, film)
        pictures.videos.append((f"The run, {PACE:g} times as fast", job.video.read_bytes()))
