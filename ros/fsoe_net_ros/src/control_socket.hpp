/** The control socket of fsn-master (docs/reference/control-protocol.md): one line, one reply. */
#ifndef CONTROL_SOCKET_HPP_
#define CONTROL_SOCKET_HPP_

#include <nlohmann/json.hpp>
#include <string>

namespace fsoe_net_ros {

class ControlSocket {
public:
    /** @param[in] wake  descriptor; as soon as it is readable a request fails. -1: none.
     *  @throws Fault  nobody answers there. */
    ControlSocket(const std::string &path, int wake);
    ~ControlSocket();
    ControlSocket(const ControlSocket &) = delete;
    ControlSocket &operator=(const ControlSocket &) = delete;

    /** Sends a request and returns its reply. @throws Fault  it is refused, or no reply comes in a second. */
    nlohmann::json request(const std::string &line);

    /** Sends a request whose reply may have several pages; returns the rows of all under `list`. */
    nlohmann::json rows(const std::string &word, const std::string &list);

private:
    void wait_for_reply();

    std::string path_, received_;
    int fd_, wake_;
};

}  // namespace fsoe_net_ros

#endif  // CONTROL_SOCKET_HPP_
