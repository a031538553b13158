"""What an arm is told to do: grasp an object and place it, or sort all of them.

``machine`` has the states and what leads from one to the next, ``gripping`` says which things can
be grasped, ``clearance`` and ``route`` keep the arm off the table and off other things,
``follower`` holds the way that the arm is on, ``pick_and_place`` is the task itself, ``goals`` says
what it is for, ``sight`` is its eye in simulation, and ``run`` joins all of it to a plant.
"""
