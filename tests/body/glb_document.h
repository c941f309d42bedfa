#pragma once

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <cstring>
#include <map>
#include <nlohmann/json.hpp>
#include <string>

namespace mvstudio::body {

/// A .glb file, read with the format's formulas alone.
struct GlbDocument {
  nlohmann::json json;
  std::string buffer;

  explicit GlbDocument(const std::string& glb) {
    EXPECT_EQ(glb.substr(0, 4), "glTF");
    EXPECT_EQ(WordAt(glb, 4), 2u);
    EXPECT_EQ(WordAt(glb, 8), glb.size());
    const size_t json_bytes = WordAt(glb, 12), buffer_at = 20 + json_bytes;
    EXPECT_EQ(glb.substr(16, 4), "JSON");
    EXPECT_EQ(json_bytes % 4, 0u);
    EXPECT_EQ(glb.substr(buffer_at + 4, 4), std::string("BIN\0", 4));
    EXPECT_EQ(WordAt(glb, buffer_at) + buffer_at + 8, glb.size());
    json = nlohmann::json::parse(glb.substr(20, json_bytes));
    buffer = glb.substr(buffer_at + 8);
    EXPECT_EQ(json["buffers"][0]["byteLength"], buffer.size());
  }

  static uint32_t WordAt(const std::string& bytes, size_t at) {
    uint32_t word = 0;
    std::memcpy(&word, bytes.data() + at, 4);
    return word;
  }

  const nlohmann::json& Accessor(const nlohmann::json& index) const { return json["accessors"].at(index.get<size_t>()); }
  const nlohmann::json& ViewOf(const nlohmann::json& accessor) const {
    return json["bufferViews"].at(accessor["bufferView"].get<size_t>());
  }

  /// (components, count) of an accessor.
  Eigen::MatrixXd Read(const nlohmann::json& index) const {
    const nlohmann::json &accessor = Accessor(index), &view = ViewOf(accessor);
    const std::map<std::string, int> components = {{"SCALAR", 1}, {"VEC2", 2}, {"VEC3", 3}, {"VEC4", 4}, {"MAT4", 16}};
    const int rows = components.at(accessor["type"]), type = accessor["componentType"];
    const size_t size = type == 5123 ? 2 : 4, offset = view["byteOffset"];
    Eigen::MatrixXd values(rows, accessor["count"].get<int>());
    EXPECT_EQ(view["byteLength"], static_cast<size_t>(values.size()) * size);
    EXPECT_EQ(offset % 4, 0u);
    EXPECT_LE(offset + static_cast<size_t>(values.size()) * size, buffer.size());
    for (Eigen::Index i = 0; i < values.size(); ++i) {
      const char* at = buffer.data() + offset + static_cast<size_t>(i) * size;
      float real = 0;
      uint32_t whole = 0;
      std::memcpy(type == 5126 ? static_cast<void*>(&real) : &whole, at, size);
      values(i) = type == 5126 ? static_cast<double>(real) : whole;
    }
    return values;
  }
  const nlohmann::json& Primitive() const { return json["meshes"].at(0)["primitives"].at(0); }
  Eigen::MatrixXd Attribute(const char* name) const { return Read(Primitive()["attributes"][name]); }
};

}  // namespace mvstudio::body
