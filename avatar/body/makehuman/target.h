#pragma once

#include <Eigen/Core>
#include <string>

namespace mvstudio::body {

/// Reads a morph of MakeHuman: lines "vertex dx dy dz", comments with #. Displacements (3, num_vertices) in the file's frame
/// and units. Throws FormatError with the line.
Eigen::Matrix3Xd ParseTarget(const std::string& text, const std::string& path, int num_vertices);

/// Content of a gzipped file, at most `max_bytes` of it. Throws FormatError.
std::string Gunzip(const std::string& bytes, const std::string& path, size_t max_bytes);

}  // namespace mvstudio::body
