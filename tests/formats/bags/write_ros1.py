"""write_ros1.py DIRECTORY [COUNT]: none.bag, bz2.bag and lz4.bag of tests/formats/bag_test.cpp's scene, by ROS' own writer."""

import math
import sys

import rosbag
import rospy
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped, TransformStamped
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Imu
from tf2_msgs.msg import TFMessage


def transform(stamp, parent, child, xyz, yaw):
    t = TransformStamped()
    t.header.stamp, t.header.frame_id, t.child_frame_id = stamp, parent, child
    t.transform.translation.x, t.transform.translation.y, t.transform.translation.z = xyz
    t.transform.rotation.z, t.transform.rotation.w = math.sin(yaw / 2), math.cos(yaw / 2)
    return t


def write(path, compression, count):
    with rosbag.Bag(path, "w", compression=compression, chunk_threshold=20000) as bag:
        start = rospy.Time(1700000000, 0)
        bag.write("/tf_static", TFMessage([transform(start, "base_link", "camera", (0.5, 0, 0.25), 0)]), start)
        for i in range(count):
            stamp = rospy.Time(1700000000 + i // 200, 5000000 * (i % 200))
            imu = Imu()
            imu.header.stamp = stamp
            imu.angular_velocity.z, imu.linear_acceleration.x, imu.linear_acceleration.z = 0.1, 0.001 * i, 9.81
            imu.orientation_covariance[0] = -1
            bag.write("/imu", imu, stamp)
            if i % 5:
                continue
            yaw, xyz = 0.01 * i, (0.1 * i, math.sin(0.01 * i), 0)
            moved = transform(stamp, "odom", "base_link", xyz, yaw)
            odometry, pose, measured = Odometry(), PoseStamped(), PoseWithCovarianceStamped()
            for message in (odometry, pose, measured):
                message.header.stamp, message.header.frame_id = stamp, "odom"
            odometry.child_frame_id = "base_link"
            for p in (odometry.pose.pose, pose.pose, measured.pose.pose):
                p.position.x, p.position.y, p.position.z = xyz
                p.orientation = moved.transform.rotation
            covariance = [0.01 * (k // 6 + 1) if k % 7 == 0 else 0.001 if k in (1, 6) else 0 for k in range(36)]
            odometry.pose.covariance = covariance
            transforms = [moved]
            if i % 20 == 0:
                transforms.append(transform(stamp, "/map", "odom", (0, 0, 1 + 0.01 * i), 0))
            bag.write("/odom", odometry, stamp)
            bag.write("/pose", pose, stamp)
            bag.write("/pose_cov", measured, stamp)
            bag.write("/moved", moved, stamp)
            bag.write("/tf", TFMessage(transforms), stamp)


for kind in ("none", "bz2", "lz4"):
    write(f"{sys.argv[1]}/{kind}.bag", kind, int(sys.argv[2]) if len(sys.argv) > 2 else 200)
