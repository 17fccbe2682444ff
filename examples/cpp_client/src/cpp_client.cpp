// Copyright 2026 The nfo_sinus_driver authors
// SPDX-License-Identifier: Apache-2.0

// A client in C++: enable a drive, send it a set-point for some time, and stop it.
//
// Copy this folder into the `src` of your workspace, build it, start the driver, and then
//
//   ros2 run nfo_sinus_cpp_client cpp_client --ros-args -p drive:=/nfo_sinus -p frequency:=20.0
//
// The motor is stopped on every way out: when the time is over, on Ctrl-C, `kill` or a closed
// terminal, when the drive drops out, and on an exception. Exit status 0: the time is over and the
// stop is confirmed.

#include <algorithm>
#include <atomic>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <exception>
#include <functional>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>

#include "nfo_sinus_msgs/msg/drive_status.hpp"
#include "rclcpp/rclcpp.hpp"
#include "std_msgs/msg/float32.hpp"
#include "std_srvs/srv/set_bool.hpp"
#include "std_srvs/srv/trigger.hpp"

using nfo_sinus_msgs::msg::DriveStatus;
using std_msgs::msg::Float32;
using std_srvs::srv::SetBool;
using std_srvs::srv::Trigger;
using Clock = std::chrono::steady_clock;
using Seconds = std::chrono::duration<double>;

namespace
{
constexpr Seconds kFindTimeout{30.0};
constexpr Seconds kAnswerTimeout{10.0};  // the driver answers a stop within about 2 s
constexpr Seconds kFollowTimeout{5.0};   // until the status says what a service has answered
constexpr Seconds kStatusTimeout{2.0};   // the oldest status that counts
constexpr Seconds kPeriod{0.1};          // of set-points; well within the driver's setpoint_timeout

// The signal handlers of rclcpp would shut ROS down before the motor can be stopped.
std::atomic<bool> interrupted{false};
static_assert(std::atomic<bool>::is_always_lock_free);

void interrupt(int) {interrupted = true;}

class CppClient : public rclcpp::Node
{
public:
  CppClient()
  : Node("cpp_client"),
    drive_(declare_parameter("drive", "/nfo_sinus")),
    frequency_(declare_parameter("frequency", 20.0)),            // Hz, negative is reverse
    duration_(declare_parameter("duration", 10.0))               // s
  {
    status_subscription_ = create_subscription<DriveStatus>(
      drive_ + "/status", rclcpp::QoS(10).reliable().durability_volatile(),
      [this](DriveStatus::ConstSharedPtr status) {
        status_ = *status;
        status_at_ = Clock::now();
      });
    setpoint_ = create_publisher<Float32>(
      drive_ + "/setpoint", rclcpp::QoS(1).best_effort().durability_volatile());
    enable_ = create_client<SetBool>(drive_ + "/enable");
    stop_ = create_client<Trigger>(drive_ + "/stop");
  }

  // Go through all of it; tell whether the time is over and the stop is confirmed.
  bool run()
  {
    executor_.add_node(get_node_base_interface());
    const bool found = spin_until(
      [this] {
        return status_.connected && enable_->service_is_ready() && stop_->service_is_ready();
      }, kFindTimeout);
    if (!found) {
      RCLCPP_ERROR(get_logger(), "no driver at %s, or its drive does not respond", drive_.c_str());
      return false;
    }
    if (status_.control_mode != DriveStatus::FREQUE) {
      RCLCPP_ERROR(get_logger(), "set-points are in %s, not in Hz", status_.unit.c_str());
      return false;
    }
    std::string problem;
    try {
      problem = drive();
    } catch (const std::exception & error) {
      problem = error.what();
    }
    // also after an enable that was not answered: the driver may have had it all the same
    const bool stopped = stop();
    if (!problem.empty()) {
      RCLCPP_ERROR(get_logger(), "%s", problem.c_str());
    }
    return stopped && problem.empty();
  }

private:
  // Enable the drive and send it the set-point; return what ended that too early.
  std::string drive()
  {
    auto request = std::make_shared<SetBool::Request>();
    request->data = true;
    const auto answer = call<SetBool>(enable_, request);
    if (!answer || !answer->success) {
      return "not enabled: " + (answer ? answer->message : "no answer");
    }
    RCLCPP_INFO(get_logger(), "%s", answer->message.c_str());
    // a status from before may still be on its way
    spin_until([this] {return status_.enabled;}, kFollowTimeout);
    const auto end = Clock::now() + Seconds(duration_);
    while (Clock::now() < end) {
      if (interrupted) {
        return "interrupted";
      }
      if (const std::string found = problem(); !found.empty()) {
        return found;
      }
      Float32 message;
      message.data = static_cast<float>(frequency_);
      setpoint_->publish(message);
      spin_until([this] {return !problem().empty();}, kPeriod);
    }
    return "";
  }

  // Stop the motor and say how it went; false: the stop is not confirmed.
  bool stop()
  {
    const auto answer = call<Trigger>(stop_, std::make_shared<Trigger::Request>());
    if (answer && answer->success) {
      RCLCPP_INFO(get_logger(), "%s", answer->message.c_str());
      return true;
    }
    RCLCPP_FATAL(
      get_logger(), "THE STOP IS NOT CONFIRMED, use the RUN input or the emergency stop: %s",
      answer ? answer->message.c_str() : "no answer");
    return false;
  }

  // Why the motor does not follow the set-point; empty if it does.
  std::string problem() const
  {
    if (Clock::now() - status_at_ > kStatusTimeout) {
      return "no status any more";
    }
    if (!status_.connected) {
      return "the drive does not respond";
    }
    if (status_.fault) {
      return "the drive has a fault: see " + drive_ + "/inv_st";
    }
    return status_.enabled ? "" : "not enabled, or stopped by another client";
  }

  // Handle messages until a condition holds; false: not in this time, or interrupted.
  bool spin_until(const std::function<bool()> & condition, Seconds timeout)
  {
    const auto end = Clock::now() + timeout;
    while (!condition()) {
      const Seconds left = end - Clock::now();
      if (interrupted || left <= Seconds::zero()) {
        return false;
      }
      executor_.spin_once(
        std::chrono::duration_cast<std::chrono::nanoseconds>(std::min(left, kPeriod)));
    }
    return true;
  }

  // Call a service and wait for its answer, also when interrupted; null: it does not answer.
  template<typename Service>
  typename Service::Response::SharedPtr call(
    const typename rclcpp::Client<Service>::SharedPtr & client,
    const typename Service::Request::SharedPtr & request)
  {
    auto future = client->async_send_request(request);
    if (executor_.spin_until_future_complete(future, kAnswerTimeout) ==
      rclcpp::FutureReturnCode::SUCCESS)
    {
      return future.get();
    }
    client->remove_pending_request(future);
    return nullptr;
  }

  const std::string drive_;
  const double frequency_;
  const double duration_;
  DriveStatus status_;
  Clock::time_point status_at_;
  rclcpp::Subscription<DriveStatus>::SharedPtr status_subscription_;
  rclcpp::Publisher<Float32>::SharedPtr setpoint_;
  rclcpp::Client<SetBool>::SharedPtr enable_;
  rclcpp::Client<Trigger>::SharedPtr stop_;
  rclcpp::executors::SingleThreadedExecutor executor_;
};
}  // namespace

int main(int argc, char * argv[])
{
  rclcpp::init(argc, argv, rclcpp::InitOptions(), rclcpp::SignalHandlerOptions::None);
  for (const int number : {SIGINT, SIGTERM, SIGHUP}) {
    std::signal(number, interrupt);
  }
  const bool done = std::make_shared<CppClient>()->run();
  rclcpp::shutdown();
  return done ? EXIT_SUCCESS : EXIT_FAILURE;
}
