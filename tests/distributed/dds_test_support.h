// For tests with several participants in one process.
#pragma once

#include <fastrtps/xmlparser/XMLProfileManager.h>

#include <random>
#include <string>

namespace soda::test {

// Participants of one process hand each other samples directly by default; this makes them use their transports.
// Once, before the first participant.
inline void use_transports_within_process() {
  eprosima::fastrtps::LibrarySettingsAttributes settings;
  settings.intraprocess_delivery = eprosima::fastrtps::INTRAPROCESS_OFF;
  eprosima::fastrtps::xmlparser::XMLProfileManager::library_settings(settings);
}

inline std::string unique_session() { return "wire-test-" + std::to_string(std::random_device()()); }

}  // namespace soda::test
