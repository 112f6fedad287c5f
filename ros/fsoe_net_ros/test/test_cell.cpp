// Facts about a cell without fsn-master; tests/ros2 of fsoe-net has those with it.
#include <cmath>
#include <gtest/gtest.h>

#include "fsoe_net_ros/cell.hpp"

namespace fsoe_net_ros {
namespace {

Cell::Options options_of(const std::string &socket) {
    Cell::Options options;
    options.socket = socket;
    return options;
}

std::string fault_of(Cell &cell) {
    try {
        cell.configure();
    } catch (const Fault &fault) {
        return fault.what();
    }
    return "";
}

TEST(Cell, a_state_is_not_a_number_before_it_is_read) {
    Cell cell(options_of("/nowhere"));
    const double *state = cell.add_state("drive/position");
    cell.read();
    EXPECT_TRUE(std::isnan(*state));
    EXPECT_EQ(cell.cycle_ns(), 0U);
}

TEST(Cell, a_name_without_a_symbol_is_unbound) {
    Cell cell(options_of("/nowhere"));
    cell.add_state("drive/position");
    cell.add_command("drive/velocity", 0);
    cell.bind_state("drive/position", "axis.position");
    EXPECT_EQ(cell.unbound(), std::vector<std::string>{"drive/velocity"});
    cell.unbind();
    EXPECT_EQ(cell.unbound(), (std::vector<std::string>{"drive/position", "drive/velocity"}));
}

TEST(Cell, a_request_of_an_axis_needs_no_symbol) {
    Cell cell(options_of("/nowhere"));
    cell.add_command("drive/home", 0);
    cell.bind_request("drive/home", cell.add_axis({}), AxisRole::kHome);
    EXPECT_TRUE(cell.unbound().empty());
}

TEST(Cell, a_missing_fsn_master_is_a_fault_with_its_socket) {
    Cell cell(options_of("/nowhere/s"));
    EXPECT_NE(fault_of(cell).find("/nowhere/s"), std::string::npos);
    EXPECT_THROW(cell.activate(), Fault);
}

TEST(Cell, a_path_that_is_too_long_is_a_fault) {
    Cell cell(options_of("/" + std::string(200, 'x')));
    EXPECT_NE(fault_of(cell).find("is not the path of a control socket"), std::string::npos);
}

class AxisMode : public testing::TestWithParam<std::pair<int, const char *>> {};

TEST_P(AxisMode, needs_its_limit_before_it_connects) {
    Cell cell(options_of("/nowhere/s"));
    AxisOptions axis;
    axis.component = "elbow";
    axis.mode = GetParam().first;
    cell.add_axis(axis);
    EXPECT_EQ(fault_of(cell).find(GetParam().second), 0U) << fault_of(cell);
}

// CiA 402: 3, 8 and 9 are modes of velocity and position, 10 of torque, 6 is homing.
INSTANTIATE_TEST_SUITE_P(OfCia402, AxisMode,
                         testing::Values(std::pair{3, "elbow has no `max_velocity`"},
                                         std::pair{8, "elbow has no `max_velocity`"},
                                         std::pair{9, "elbow has no `max_velocity`"},
                                         std::pair{10, "elbow has no `max_effort`"},
                                         std::pair{6, "no answer on /nowhere/s"}));

}  // namespace
}  // namespace fsoe_net_ros
