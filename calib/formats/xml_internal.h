#pragma once

#include <pugixml.hpp>
#include <string>

/// XML of other programs, parsed by pugixml. Included by .cc files of calib/ only.
namespace mvstudio::calib::internal {

/// Fills an empty document. Throws FormatError with the line for text that is not well-formed, and for what calibration files
/// do without: a document type, nesting deeper than 64 levels, an attribute twice, NUL. Entities are XML's own five and
/// numbers.
void ParseXml(const std::string& path, const std::string& text, pugi::xml_document* document);

}  // namespace mvstudio::calib::internal
