// The robot description of ethercat_driver_ros2 on fsn-master: only the plugin of the hardware differs.
// `fsoe-net` checks it, compiles the plan, and finds the name of each interface in it.
#ifndef ETHERCAT_DRIVER_HPP_
#define ETHERCAT_DRIVER_HPP_

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <hardware_interface/component_parser.hpp>
#include <memory>
#include <string>
#include <vector>

#include "cell_system.hpp"
#include "control_socket.hpp"
#include "process.hpp"

namespace fsoe_net_ros {

/** A folder that only this user can read; removed with its content. */
class PrivateFolder {
public:
    PrivateFolder() {
        std::string name = (std::filesystem::temp_directory_path() / "fsoe_net_ros-XXXXXX").string();
        if (mkdtemp(name.data()) == nullptr) {
            throw Fault("no folder for the plan: " + std::string(std::strerror(errno)));
        }
        path_ = name;
    }
    ~PrivateFolder() {
        std::error_code ignored;
        std::filesystem::remove_all(path_, ignored);
    }
    PrivateFolder(const PrivateFolder &) = delete;
    PrivateFolder &operator=(const PrivateFolder &) = delete;
    std::string operator/(const char *name) const { return (path_ / name).string(); }

private:
    std::filesystem::path path_;
};

class EthercatDriver : public CellSystem {
public:
    CallbackReturn on_configure(const rclcpp_lifecycle::State &state) override {
        const auto prepared = guarded(CallbackReturn::FAILURE, [this] { prepare(); });
        return prepared == CallbackReturn::SUCCESS ? CellSystem::on_configure(state) : prepared;
    }
    CallbackReturn on_cleanup(const rclcpp_lifecycle::State &state) override {
        const auto done = CellSystem::on_cleanup(state);
        master_.stop();
        return done;
    }
    CallbackReturn on_shutdown(const rclcpp_lifecycle::State &state) override {
        const auto done = CellSystem::on_shutdown(state);
        master_.stop();
        return done;
    }

protected:
    std::string socket() const override { return parameter("socket", ""); }

private:
    static constexpr unsigned kToolS = 60, kStartS = 30;
    static constexpr int kLookMs = 50;
    static constexpr std::size_t kMostText = 8192;  // in the log

    void prepare() {
        const auto folder = std::make_unique<PrivateFolder>();
        const std::string robot = description(*folder);
        const std::string plan = *folder / "robot.fsnplan", control = *folder / "control.urdf.xacro";
        warn(tool({"plan", robot, "-o", plan}).errors);
        warn(tool({"convert", robot, "-o", control, "--to", "ros2-control"}).errors);
        const auto facts =
            nlohmann::json::parse(tool({"plan", "--show", plan, "--format", "json"}).out, nullptr, false);
        if (!facts.is_object() || !facts.contains("sha256") || !facts["sha256"].is_string()) {
            throw Fault("`fsoe-net plan --show` gives no hash: use the fsoe-net of this package's tree");
        }
        const auto blocks = hardware_interface::parse_control_resources_from_urdf(text_of(control));
        if (blocks.empty()) {
            throw Fault("`fsoe-net convert` has found no interface");
        }
        bind(blocks.front());
        for (const std::string &name : cell_->unbound()) {
            warn(name + ": the plan has nothing for this interface; it has no value and no effect");
        }
        cell_->check_axes();
        const std::string path = socket_path();
        cell_->use(path, facts["sha256"].get<std::string>());
        const auto status = status_of(path);
        if (status.is_null()) {
            start_master(plan, path);
        } else if (status.value("plan_sha256", "") != facts["sha256"]) {
            throw Fault("the fsn-master at " + path + " drives another plan: end it, or set another `socket`");
        }
    }

    static void warn(const std::string &text) {
        if (!text.empty()) {
            RCLCPP_WARN(logger(), "%s", text.substr(0, kMostText).c_str());
        }
    }

    /** The file of the robot description. */
    std::string description(const PrivateFolder &folder) const {
        const std::string given = parameter("description", "");
        if (!given.empty()) {
            return given;
        }
        const std::string text = original_of(info_, 0);
        if (text.empty()) {
            throw Fault("this version of ros2_control does not pass the robot description to the hardware; "
                        "give its file as param `description` of the hardware");
        }
        const std::string path = folder / "robot.urdf";
        std::ofstream(path) << text;
        return path;
    }

    template <class Info> static auto original_of(const Info &info, int) -> decltype(info.original_xml) {
        return info.original_xml;
    }
    template <class Info> static std::string original_of(const Info &, double) { return ""; }

    static std::string text_of(const std::string &path) {
        std::ifstream file(path);
        return {std::istreambuf_iterator<char>(file), {}};
    }

    /** Runs fsoe-net. @throws Fault  its findings. */
    Outcome tool(std::vector<std::string> words) const {
        words.insert(words.begin(), parameter("fsoe_net", "fsoe-net"));
        Outcome done = run_program(words, 1000 * static_cast<int>(number("fsoe_net_s", kToolS)));
        if (done.code != 0) {
            throw Fault("`fsoe-net " + words[1] + "` does not accept the robot description:\n" +
                        done.errors.substr(0, kMostText));
        }
        return done;
    }

    /** Network interface of the bus. */
    std::string interface() const {
        const char *environment = std::getenv("FSN_INTERFACE");
        const std::string name = parameter("interface", environment != nullptr ? environment : "");
        if (name.empty()) {
            throw Fault("the network interface of the bus is unknown; set FSN_INTERFACE in the environment, or "
                        "the param `interface` or `socket` of the hardware");
        }
        return name;
    }

    /** The socket that is stated, or that fsn-master has by default. */
    std::string socket_path() const {
        if (!socket().empty()) {
            return socket();
        }
        const std::string name = "/fsn-master-" + interface() + ".sock";
        const std::string service = "/run/fsn-master" + name;
        if (std::filesystem::exists(service)) {
            return service;
        }
        for (const char *variable : {"RUNTIME_DIRECTORY", "XDG_RUNTIME_DIR"}) {
            if (const char *folder = std::getenv(variable)) {
                return folder + name;
            }
        }
        return "/run" + name;
    }

    /** Status of an fsn-master; null: none answers. */
    static nlohmann::json status_of(const std::string &path) {
        try {
            return ControlSocket(path, -1).request("status");
        } catch (const Fault &) {
            return nullptr;
        }
    }

    static bool is_running(const nlohmann::json &status) {
        return status.is_object() && status.value("state", "") == "running";
    }

    void start_master(const std::string &plan, const std::string &path) {
        std::vector<std::string> words{"setpriv", "--pdeathsig", "TERM", "--",
                                       parameter("fsn_master", "fsn-master"), plan, "--interface", interface(),
                                       "--socket", path};
        if (const std::string bus = parameter("bus", ""); !bus.empty()) {
            words.insert(words.end(), {"--bus", bus});
        }
        master_.start(words);
        const auto until = std::chrono::steady_clock::now() + std::chrono::seconds(kStartS);
        while (!is_running(status_of(path))) {
            if (!master_.is_running()) {
                throw Fault("fsn-master has ended; its messages are above");
            }
            if (std::chrono::steady_clock::now() > until) {
                master_.stop();
                throw Fault("the bus does not run after " + std::to_string(kStartS) + " s");
            }
            std::this_thread::sleep_for(std::chrono::milliseconds(kLookMs));
        }
    }

    Child master_;
};

}  // namespace fsoe_net_ros

#endif  // ETHERCAT_DRIVER_HPP_
