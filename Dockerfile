# ROS 2 Jazzy, and both packages built in the ordinary way; the commands are those of README.md.
#
#   docker build -t nfo_sinus_driver .
#   docker run -it --rm --init nfo_sinus_driver ros2 launch nfo_sinus_driver simulation.launch.py
FROM ros:jazzy

# rosdep installs the packages that package.xml names
RUN apt-get update \
    && apt-get install --yes --no-install-recommends python3-colcon-common-extensions \
    && rm -rf /var/lib/apt/lists/*

WORKDIR /workspace
COPY . src/nfo_sinus_driver
# no tool looks for a package inside another one
RUN ln -s nfo_sinus_driver/msg_defs src/nfo_sinus_msgs

RUN apt-get update \
    && rosdep update --rosdistro jazzy \
    && rosdep install --from-paths src -i --rosdistro jazzy --default-yes \
    && rm -rf /var/lib/apt/lists/*
RUN . /opt/ros/jazzy/setup.sh \
    && colcon build

# the entry point of the base image knows its own packages alone
RUN sed --in-place '/^exec/i source /workspace/install/setup.bash' /ros_entrypoint.sh

# ros2 launch stops what it started on SIGINT, on SIGTERM it does not; with --init the signal goes
# to every process of the group, so that ros2 run, which passes nothing on, does no harm
STOPSIGNAL SIGINT
ENV TINI_KILL_PROCESS_GROUP=1
CMD ["bash"]
