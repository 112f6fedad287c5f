// The classes of this library, for pluginlib.
#include <pluginlib/class_list_macros.hpp>

#include "cell_system.hpp"
#include "ethercat_driver.hpp"

PLUGINLIB_EXPORT_CLASS(fsoe_net_ros::CellSystem, hardware_interface::SystemInterface)
PLUGINLIB_EXPORT_CLASS(fsoe_net_ros::EthercatDriver, hardware_interface::SystemInterface)
