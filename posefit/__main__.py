from posefit.cli import main

main()
