// Private: pugixml's types, for the readers of calib/.
#pragma once

#include <pugixml.hpp>
#include <string>

/// XML of other programs, parsed by pugixml.
namespace mvstudio::calib::internal {

/// Parses into an empty document. Throws FormatError with the line for text that is not well-formed, and for what
/// calibration files do not need: a document type, nesting deeper than 64 levels, a repeated attribute, NUL. Entities are
/// XML's five and numeric ones.
void ParseXml(const std::string& path, const std::string& text, pugi::xml_document* document);

}  // namespace mvstudio::calib::internal
