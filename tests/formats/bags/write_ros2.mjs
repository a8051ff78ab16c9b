// write_ros2.mjs NODE_MODULES DIRECTORY [COUNT]: the same scene in CDR: none.mcap, lz4.mcap, zstd.mcap, unindexed.mcap,
// run.db3, run.db3.zstd and split_db3/, by @mcap/core, @foxglove/rosmsg2-serialization, sqlite3, lz4 and zstd.
import { execFileSync } from "child_process";
import fs from "fs";
import { createRequire } from "module";

const [, , modules, directory, count = "200"] = process.argv;
const load = createRequire(fs.realpathSync(modules) + "/x.js");
const { McapWriter } = load("@mcap/core");
const { MessageWriter } = load("@foxglove/rosmsg2-serialization");
const { parse } = load("@foxglove/rosmsg");

const header = "std_msgs/Header header\n";
const rest = `
===
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
===
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
===
MSG: geometry_msgs/Vector3
float64 x
float64 y
float64 z
===
MSG: geometry_msgs/Quaternion
float64 x
float64 y
float64 z
float64 w
===
MSG: geometry_msgs/Pose
geometry_msgs/Vector3 position
geometry_msgs/Quaternion orientation
===
MSG: geometry_msgs/PoseWithCovariance
geometry_msgs/Pose pose
float64[36] covariance
===
MSG: geometry_msgs/Twist
geometry_msgs/Vector3 linear
geometry_msgs/Vector3 angular
===
MSG: geometry_msgs/TwistWithCovariance
geometry_msgs/Twist twist
float64[36] covariance
===
MSG: geometry_msgs/Transform
geometry_msgs/Vector3 translation
geometry_msgs/Quaternion rotation
===
MSG: geometry_msgs/TransformStamped
${header}string child_frame_id
geometry_msgs/Transform transform`;
const types = {
  "geometry_msgs/msg/PoseStamped": header + "geometry_msgs/Pose pose",
  "geometry_msgs/msg/PoseWithCovarianceStamped": header + "geometry_msgs/PoseWithCovariance pose",
  "geometry_msgs/msg/TransformStamped": header + "string child_frame_id\ngeometry_msgs/Transform transform",
  "nav_msgs/msg/Odometry":
    header + "string child_frame_id\ngeometry_msgs/PoseWithCovariance pose\ngeometry_msgs/TwistWithCovariance twist",
  "tf2_msgs/msg/TFMessage": "geometry_msgs/TransformStamped[] transforms",
  "sensor_msgs/msg/Imu":
    header +
    "geometry_msgs/Quaternion orientation\nfloat64[9] orientation_covariance\n" +
    "geometry_msgs/Vector3 angular_velocity\nfloat64[9] angular_velocity_covariance\n" +
    "geometry_msgs/Vector3 linear_acceleration\nfloat64[9] linear_acceleration_covariance",
};
const topics = {
  "/tf_static": "tf2_msgs/msg/TFMessage", "/tf": "tf2_msgs/msg/TFMessage", "/imu": "sensor_msgs/msg/Imu",
  "/odom": "nav_msgs/msg/Odometry", "/pose": "geometry_msgs/msg/PoseStamped",
  "/pose_cov": "geometry_msgs/msg/PoseWithCovarianceStamped", "/moved": "geometry_msgs/msg/TransformStamped",
};
const writers = Object.fromEntries(
  Object.entries(types).map(([name, text]) => [name, new MessageWriter(parse(text + rest, { ros2: true }))]),
);

const messages = []; // topic, ns, bytes
const add = (topic, ns, message) => messages.push([topic, ns, writers[topics[topic]].writeMessage(message)]);
const quaternion = (yaw) => ({ x: 0, y: 0, z: Math.sin(yaw / 2), w: Math.cos(yaw / 2) });
const zeros = { x: 0, y: 0, z: 0 };
const transform = (stamp, parent, child, [x, y, z], yaw) => ({
  header: { stamp, frame_id: parent }, child_frame_id: child,
  transform: { translation: { x, y, z }, rotation: quaternion(yaw) },
});
const start = 1700000000000000000n;
add("/tf_static", start, {
  transforms: [transform({ sec: 1700000000, nanosec: 0 }, "base_link", "camera", [0.5, 0, 0.25], 0)],
});
for (let i = 0; i < Number(count); ++i) {
  const ns = start + 5000000n * BigInt(i);
  const stamp = { sec: Number(ns / 1000000000n), nanosec: Number(ns % 1000000000n) };
  const head = { stamp, frame_id: "odom" };
  add("/imu", ns, {
    header: { stamp, frame_id: "imu" }, orientation: quaternion(0),
    orientation_covariance: [-1, 0, 0, 0, 0, 0, 0, 0, 0],
    angular_velocity: { x: 0, y: 0, z: 0.1 }, angular_velocity_covariance: Array(9).fill(0),
    linear_acceleration: { x: 0.001 * i, y: 0, z: 9.81 }, linear_acceleration_covariance: Array(9).fill(0),
  });
  if (i % 5) continue;
  const yaw = 0.01 * i, xyz = [0.1 * i, Math.sin(0.01 * i), 0];
  const moved = transform(stamp, "odom", "base_link", xyz, yaw);
  const pose = { position: { x: xyz[0], y: xyz[1], z: xyz[2] }, orientation: quaternion(yaw) };
  const covariance = Array.from({ length: 36 }, (_, k) =>
    k % 7 == 0 ? 0.01 * (Math.floor(k / 6) + 1) : k == 1 || k == 6 ? 0.001 : 0);
  add("/odom", ns, {
    header: head, child_frame_id: "base_link", pose: { pose, covariance },
    twist: { twist: { linear: zeros, angular: zeros }, covariance: Array(36).fill(0) },
  });
  add("/pose", ns, { header: head, pose });
  add("/pose_cov", ns, { header: head, pose: { pose, covariance: Array(36).fill(0) } });
  add("/moved", ns, moved);
  const over = i % 20 ? [] : [transform(stamp, "map", "odom", [0, 0, 1 + 0.01 * i], 0)];
  add("/tf", ns, { transforms: [moved, ...over] });
}

const compressed = (tool, data) => execFileSync(tool, ["-c", "-q"], { input: data, maxBuffer: 1 << 28 });
async function writeMcap(name, compression, options) {
  const parts = [];
  let length = 0n;
  const writable = {
    position: () => length,
    write: async (bytes) => {
      parts.push(Buffer.from(bytes));
      length += BigInt(bytes.length);
    },
  };
  const compressChunk =
    compression && ((data) => ({ compression, compressedData: compressed(compression, data) }));
  const writer = new McapWriter({ writable, compressChunk, chunkSize: 20000, ...options });
  await writer.start({ profile: "ros2", library: "test" });
  const channels = {};
  for (const [topic, type] of Object.entries(topics)) {
    const data = new TextEncoder().encode(types[type] + rest.replaceAll("===", "=".repeat(80)));
    const schemaId = await writer.registerSchema({ name: type, encoding: "ros2msg", data });
    channels[topic] = await writer.registerChannel({ schemaId, topic, messageEncoding: "cdr", metadata: new Map() });
  }
  for (const [topic, ns, data] of messages) {
    await writer.addMessage({ channelId: channels[topic], sequence: 0, logTime: ns, publishTime: ns, data });
  }
  await writer.end();
  fs.writeFileSync(`${directory}/${name}.mcap`, Buffer.concat(parts));
}
await writeMcap("none", undefined, {});
await writeMcap("lz4", "lz4", {});
await writeMcap("zstd", "zstd", {});
await writeMcap("unchunked", undefined, { useChunks: false });
await writeMcap("unindexed", "zstd", { useMessageIndex: false, useChunkIndex: false, repeatSchemas: false,
                                       repeatChannels: false, useStatistics: false, useSummaryOffsets: false });

// rosbag2's tables; a directory of two files, of which the second has odometry compressed message by message.
const names = Object.keys(topics);
function writeDatabase(file, list, encode) {
  const rows = names.map((t, k) => `INSERT INTO topics VALUES(${k + 1},'${t}','${topics[t]}','cdr','');`);
  for (const [topic, ns, data] of list) {
    const hex = Buffer.from(encode(topic, data)).toString("hex");
    rows.push(`INSERT INTO messages(topic_id,timestamp,data) VALUES(${names.indexOf(topic) + 1},${ns},x'${hex}');`);
  }
  const tables = `CREATE TABLE topics(id INTEGER PRIMARY KEY,name TEXT NOT NULL,type TEXT NOT NULL,serialization_format
TEXT NOT NULL,offered_qos_profiles TEXT NOT NULL);CREATE TABLE messages(id INTEGER PRIMARY KEY,topic_id INTEGER NOT
NULL,timestamp INTEGER NOT NULL,data BLOB NOT NULL);CREATE INDEX timestamp_idx ON messages(timestamp ASC);`;
  fs.rmSync(file, { force: true });
  execFileSync("sqlite3", [file], { input: `${tables}BEGIN;${rows.join("\n")}COMMIT;` });
}
writeDatabase(`${directory}/run.db3`, messages, (_, data) => data);
fs.writeFileSync(`${directory}/run.db3.zstd`, compressed("zstd", fs.readFileSync(`${directory}/run.db3`)));
fs.mkdirSync(`${directory}/split_db3`, { recursive: true });
const half = messages.length / 2;
writeDatabase(`${directory}/split_db3/run_9.db3`, messages.slice(0, half), (_, data) => data);
writeDatabase(`${directory}/split_db3/run_10.db3`, messages.slice(half), (topic, data) =>
  topic == "/odom" ? compressed("zstd", data) : data);
