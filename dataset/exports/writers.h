#pragma once

#include <string>
#include <vector>

#include "dataset/exports/images.h"
#include "dataset/exports/ply.h"
#include "dataset/exports/take.h"

/// One function per format; included by this module's .cc files only. Each writes its own files below the job's folder and
/// lists images and masks with `images`.
namespace mvstudio::exports {

struct Job {
  const Take& take;
  Images& images;
  const ExportOptions& options;
  const RunContext& run;
  std::string folder;
  ExportReport* report;
  std::string file = {};  ///< where given, the format's only file goes there

  /// Writes a file at a path relative to the folder and lists it in the report.
  void Write(const std::string& path, const std::string& content) const;
};

void WriteColmap(const Job& job);
void WriteNerfstudio(const Job& job);
void WriteZju(const Job& job);
void WriteEasyMocap(const Job& job);
void WriteActorsHq(const Job& job);
void WriteDynamic3dgs(const Job& job);
void WriteDna(const Job& job);
void WriteHumman(const Job& job);
void WriteTrc(const Job& job);
void WriteC3d(const Job& job);
void WriteBvh(const Job& job);
void WriteCsv(const Job& job);
void WriteNpz(const Job& job);
void WriteGltf(const Job& job);
void WritePly(const Job& job);
void WriteBlender(const Job& job);
void WriteRos(const Job& job);
void WriteMcap(const Job& job);

/// Warns of what the programs that read the format cannot hold of these cameras.
void NoteReaderLimits(const Job& job);
/// True where the reader opens the mask of every image and stops when there is none.
bool OpensEveryMask(const std::string& format);

/// The exported cameras, in the order of the views.
geometry::Rig RigOf(const Take& take, const std::vector<size_t>& views);
std::vector<size_t> AllViews(const Take& take);
/// 3x3, row by row; `shift_px` is added to the principal point.
std::vector<double> MatrixOf(const geometry::Camera& camera, double shift_px = 0);
/// [R t; 0 1], row by row.
std::vector<double> RowsOf(const geometry::Rigid3& b_from_a);

struct StartPoint : ColouredPoint {
  std::vector<size_t> seen_by;  ///< indices into the take's views, ascending: two or more
};
/// Initial points for a reconstruction of this frame: the surface of the silhouettes' hull, in the median colour of the
/// cameras that see it. Where there are no masks: joints and points along the bones, grey, of all images that they lie in.
/// Empty when nobody is present or options.hull_points is 0. Counted in the report.
std::vector<StartPoint> StartPoints(const Job& job, int frame);
/// Of the exported cameras, in the order of the views.
std::vector<geometry::Projector> ProjectorsOf(const Take& take);
/// The views in whose images the point lies, ascending.
std::vector<size_t> ViewsAround(const Take& take, const std::vector<geometry::Projector>& projectors,
                                const Eigen::Vector3d& x_in_world);

/// Throws FormatError when the frames contain no joint of anybody.
void RequirePeople(const Job& job);

}  // namespace mvstudio::exports
