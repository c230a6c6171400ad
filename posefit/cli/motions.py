"""`posefit motions`."""

import json

import click


@click.command()
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def motions(as_json: bool) -> None:
    """List the motions that posefit brings along: built-in ones, and recorded ones of ten people."""
    from posefit.motion import built_in, recorded

    clips = recorded.clips()
    if as_json:
        people = [
            {"name": one.name, "subject": one.subject, "seconds": round(one.seconds, 3), "poses": len(one)}
            for one in clips
        ]
        click.echo(json.dumps({"built_in": built_in.names(), "recorded": people}))
        return
    click.echo("built in, made by a model; the letters are different people\n")
    click.echo(f"  {' '.join(built_in.names())}\n")
    click.echo("recorded, in the CMU database (mocap.cs.cmu.edu); --train library learns from all of them\n")
    for subject in recorded.subjects():
        mine = [one for one in clips if one.subject == subject]
        minutes, ends = sum(one.seconds for one in mine) / 60.0, f"{mine[0].name} to {mine[-1].name}"
        click.echo(f"  library:{subject:4} {len(mine):3} clips, {minutes:5.1f} minutes: {ends}")
