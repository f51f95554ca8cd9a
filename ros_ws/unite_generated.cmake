# Read by make through CMAKE_PROJECT_INCLUDE: compiles the C++ that rosidl generates as one file a library, which halves
# the time of the whole build. The generated C cannot be united: its files repeat static names.
function(unite_generated)
  get_property(targets DIRECTORY PROPERTY BUILDSYSTEM_TARGETS)
  list(FILTER targets INCLUDE REGEX "typesupport_(c|cpp|fastrtps_c|fastrtps_cpp|introspection_cpp)$")
  set_target_properties(${targets} PROPERTIES UNITY_BUILD ON UNITY_BUILD_BATCH_SIZE 0)
endfunction()
cmake_language(DEFER CALL unite_generated)
