"""`posefit motions`."""

import click

from posefit.cli.output import print_result


@click.command()
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def motions(as_json: bool) -> None:
    """List the motions that posefit brings along: built-in ones, and recorded ones of ten people."""
    from posefit.motion import built_in, recorded

    clips = recorded.clips()
    people = [
        {"name": one.name, "subject": one.subject, "seconds": round(one.seconds, 3), "poses": len(one)} for one in clips
    ]
    lines = ["built in, made by a model; the letters are different people", "", f"  {' '.join(built_in.names())}", ""]
    lines += ["recorded, in the CMU database (mocap.cs.cmu.edu); --train library learns from all of them", ""]
    for subject in recorded.subjects():
        mine = [one for one in clips if one.subject == subject]
        minutes, ends = sum(one.seconds for one in mine) / 60.0, f"{mine[0].name} to {mine[-1].name}"
        lines.append(f"  library:{subject:4} {len(mine):3} clips, {minutes:5.1f} minutes: {ends}")
    print_result(lines, {"built_in": built_in.names(), "recorded": people}, as_json)
