// A client as written for the original robot, with roslib.js: tells in JSON what came of it.
import * as ROSLIB from "roslib";

const ros = new ROSLIB.Ros({ url: `ws://127.0.0.1:${process.argv[2]}` });
await new Promise((connected, failed) => {
  ros.on("connection", connected);
  ros.on("error", failed);
});

const taskServer = (actionType) => new ROSLIB.Action({ ros, name: "/task_server", actionType });

function goal(client, task) {
  const reported = { feedback: [], end: null };
  let begun;
  const moving = new Promise((resolve) => (begun = resolve));
  let identity;
  const ended = new Promise((resolve) => {
    identity = client.sendGoal(
      { task_number: task },
      (values) => resolve({ ...reported, end: { kind: "result", status: 4, values } }),
      (feedback) => begun(reported.feedback.push(feedback.percentage)),
      (error) => resolve({ ...reported, end: { kind: "error", values: error } }),
    );
  });
  return { identity, moving, ended };
}

const first = (name, messageType) =>
  new Promise((resolve) => {
    const topic = new ROSLIB.Topic({ ros, name, messageType });
    topic.subscribe((message) => {
      topic.unsubscribe();
      resolve(message);
    });
  });

const client = taskServer("arduinobot_msgs/action/ArduinobotTask");
const reported = { moved: await goal(client, 1).ended, failed: await goal(client, 99).ended };
const waiting = goal(client, 10);
await waiting.moving;
reported.busy = await goal(client, 11).ended;
client.cancelGoal(waiting.identity);
reported.canceled = await waiting.ended;
const moving = goal(client, 0);
await moving.moving;
client.cancelAllGoals();
reported.stopped = await moving.ended;
reported.other = await goal(taskServer("arduinobot_msgs/action/Other"), 1).ended;
reported.many = [];
for (let n = 0; n < 50; n++) reported.many.push((await goal(client, 11).ended).end.values);
reported.joints = await first("/joint_states", "sensor_msgs/JointState");
reported.status = await first("/task_server/_action/status", "action_msgs/GoalStatusArray");
console.log(JSON.stringify(reported));
ros.close();
process.exit(0);
