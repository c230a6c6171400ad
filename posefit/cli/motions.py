"""`posefit motions`."""

import click

from posefit.cli.output import print_result


@click.command()
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def motions(as_json: bool) -> None:
    """List the motions that come with posefit: built-in ones, and recorded people."""
    from posefit.motion import built_in, recorded

    clips = recorded.clips()
    people = []
    for clip in clips:
        person = {
            "name": clip.name,
            "subject": clip.subject,
            "seconds": round(clip.seconds, 3),
            "poses": len(clip),
        }
        people.append(person)
    lines = [
        "built in, made by a model; the letters are different people",
        "",
        f"  {' '.join(built_in.names())}",
        "",
        "recorded, in the CMU database (mocap.cs.cmu.edu); "
        "--train library learns from all of them",
        "",
    ]
    for subject in recorded.subjects():
        parts = [clip for clip in clips if clip.subject == subject]
        minutes = sum(clip.seconds for clip in parts) / 60.0
        ends = f"{parts[0].name} to {parts[-1].name}"
        size = f"{len(parts):3} clips, {minutes:5.1f} minutes"
        lines.append(f"  library:{subject:4} {size}: {ends}")
    print_result(lines, {"built_in": built_in.names(), "recorded": people}, as_json)
