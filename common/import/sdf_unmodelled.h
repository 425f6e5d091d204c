// Finds what an SDF file asks for and SODA does not model, so that nothing is dropped in silence.
#pragma once

#include <sdf/Element.hh>
#include <string>

#include "common/import/warnings.h"

namespace soda {

// Goes through an element that libsdformat has read (a <world> or <model>) and warns of every child that the file gives
// and that the import does not use, each kind once; what is below such a child is not looked at. `uses`: how often
// each counts.
void warn_of_unmodelled(sdf::Element& element, const std::string& place, std::size_t uses, Warnings& warnings);

}  // namespace soda
