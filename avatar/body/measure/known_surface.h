#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "avatar/body/measure/surface_tree.h"

namespace mvstudio::body {

/// The true surface of a take, as synth writes it and as docs/formats.md describes it ("Truth of a surface"): meshes with one
/// topology, their vertices in some frames.
class KnownSurface {
 public:
  /// `folder` holds subject_rest.npz and vertices_%08d.npz, or has a folder `truth` that does. Throws IoError when it holds
  /// neither or no frame, FormatError with file and array.
  explicit KnownSurface(const std::string& folder);

  struct Mesh {
    std::string name;
    Eigen::Matrix3Xi faces;        // (3, F) all, triangles
    Eigen::Matrix3Xi outer_faces;  // without those whose corners are all covered
    Eigen::Matrix3Xd rest;         // (3, V) in body, metres
    std::vector<int> bare;         // vertices that are not covered
    Eigen::MatrixXd weights;       // (B, V) of skinning; empty when the file has none
  };
  const std::vector<Mesh>& meshes() const { return meshes_; }
  const std::vector<int>& frames() const { return frames_; }

  /// The vertices of every mesh in world, (3, V) metres. Throws FormatError.
  std::vector<Eigen::Matrix3Xd> Vertices(int frame) const;
  /// All outer faces as one surface.
  Surface Outer(const std::vector<Eigen::Matrix3Xd>& vertices) const;

  /// Vertices of a mesh with the frame's bones taken out: where they would be in the rest pose, (3, V) in body. NaN where the
  /// bones of a vertex fold it flat. Nothing when the files hold no weights or no bones for the frame.
  std::optional<Eigen::Matrix3Xd> Unposed(const Mesh& mesh, const Eigen::Matrix3Xd& vertices, int frame) const;

 private:
  void ReadMeshes();
  void ReadBones();

  std::string folder_;
  std::vector<Mesh> meshes_;
  std::vector<int> frames_;
  std::vector<double> transforms_;  // (N, B, 3, 4) world from rest
  int64_t num_transforms_ = 0, num_bones_ = 0;
};

}  // namespace mvstudio::body
