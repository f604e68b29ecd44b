# The command line with the software renderer: docker build -t aerialdojo-gen . && docker run -v "$PWD/data:/data" aerialdojo-gen run pipelines/smoke.toml
FROM python:3.11-slim-bookworm
RUN apt-get update && apt-get install -y --no-install-recommends libegl1 libgl1 libgl1-mesa-dri \
    && rm -rf /var/lib/apt/lists/*
WORKDIR /opt/aerialdojo-gen
COPY . .
# Editable: a checkout's recipes and annotations are used where they lie, and pipelines/ can be named as README does.
RUN pip install --no-cache-dir -c constraints.txt -e '.[gl,web]' && mkdir /data && chmod 777 /data
ENV AERIALDOJO_DATA=/data HOME=/tmp NUMBA_CACHE_DIR=/tmp/numba
VOLUME /data
ENTRYPOINT ["aerialdojo-gen"]
CMD ["--help"]
