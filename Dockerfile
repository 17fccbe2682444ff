# ROS 2 Jazzy, and both packages built in the ordinary way; the commands are those of README.md.
#
#   docker build -t nfo_sinus_driver .
#   docker run -it --rm --init --name nfo_sinus nfo_sinus_driver \
#       ros2 launch nfo_sinus_driver simulation.launch.py
#
# and what is typed into it, in another terminal:
#
#   docker exec -it nfo_sinus /ros_entrypoint.sh ros2 topic echo /nfo_sinus/actual_speed
FROM ros:jazzy

# Where colcon looks: no tool looks for a package inside another one.
WORKDIR /workspace
RUN mkdir --parents src/nfo_sinus_driver/msg_defs \
    && ln -s nfo_sinus_driver/msg_defs src/nfo_sinus_msgs

# rosdep installs the packages that package.xml names. Only what it reads is there by then, so that an
# edited file costs no new download.
COPY package.xml src/nfo_sinus_driver/
COPY msg_defs/package.xml src/nfo_sinus_driver/msg_defs/
RUN apt-get update \
    && apt-get install --yes --no-install-recommends python3-colcon-common-extensions \
    && rosdep update --rosdistro jazzy \
    && rosdep install --from-paths src -i --rosdistro jazzy --default-yes \
    && rm -rf /var/lib/apt/lists/*

COPY . src/nfo_sinus_driver
RUN . /opt/ros/jazzy/setup.sh \
    && colcon build

# the entry point of the base image knows its own packages alone
RUN sed --in-place '/^exec/i source /workspace/install/setup.bash' /ros_entrypoint.sh

# ros2 launch stops what it started on SIGINT, on SIGTERM it does not; with --init the signal goes
# to every process of the group, so that ros2 run, which passes nothing on, does no harm
STOPSIGNAL SIGINT
ENV TINI_KILL_PROCESS_GROUP=1
CMD ["bash"]
